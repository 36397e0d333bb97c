"""Walkers with changing modes of their feet or stops: knees that lock, a wheel without a rim."""

import math
from typing import TYPE_CHECKING, Any

import jaxbiped as jb
from jaxbiped._checks import check_at_least, check_positive

if TYPE_CHECKING:
    from jaxbiped._types import Parameter


def hsu_chen(slope: "Parameter" = 0.0504) -> "jb.RigidScene":
    """A walker with knees and point feet: point masses on thighs, shanks and hip; legs of 1 m.

    A knee locks when it is straight, and stays locked until its leg has struck and stood. The
    paper measures angles from the vertical: its q1 is `theta_thigh_2` minus the slope, its q2 and
    q3 are `theta_thigh_1` and `theta_shank_1` minus the slope. It does not state g; here g is
    9.81 m/s².

    Source: Hsu Chen 2007, Passive dynamic walking with knees: a point foot model, thesis, MIT.

    Args:
        slope: slope of the ground [rad].

    Returns:
        The walker on rigid feet.

    Raises:
        ArgumentError: the slope is not allowed.
    """
    walker = jb.Kneed(
        m_thigh=0.5,
        J_thigh=0.0,
        l_thigh=0.5,
        d_thigh=0.325,
        m_shank=0.05,
        J_shank=0.0,
        l_shank=0.5,
        d_shank=0.125,
        w_shank=0.0,
        r=0.0,
        hip_mass=0.5,
        epsilon=0.0,
        holds="through heel strike",
    )
    return jb.RigidScene(walker, jb.Ground(slope=slope, g=9.81))


def rimless_wheel(
    slope: "Parameter" = 0.08, *, spokes: int = 8, inertia: "Parameter" = 0.5
) -> "jb.RigidScene":
    """A wheel without a rim that rolls from spoke to spoke; mass, spoke length and gravity are 1.

    With the angle 2α between spokes, an impact multiplies the rate ω by
    η = (inertia + cos 2α)/(inertia + 1), and the multiplier of the gait is η².

    Source: McGeer 1990, Passive dynamic walking; Coleman, Chatterjee and Ruina 1997, Motions of a
    rimless spoked wheel: a simple three-dimensional system with impacts.

    Args:
        slope: slope of the ground [rad].
        spokes: number of spokes.
        inertia: moment of inertia about the hub, above 0 [in units of the mass times the squared
            length of a spoke].

    Returns:
        The wheel on rigid feet.

    Raises:
        ArgumentError: a number is not allowed.
    """
    check_at_least("spokes", spokes, "3", 3)
    check_positive("inertia", inertia)
    hub: Any = 0.0
    tips: list[Any] = [
        (math.cos(turn), math.sin(turn))
        for turn in (2.0 * math.pi * k / spokes for k in range(spokes))
    ]
    wheel = jb.Mechanism(
        root="hub",
        bodies=(jb.Body("wheel", mass=1.0, inertia=inertia, centre=hub),),
        feet=tuple(jb.Foot("wheel", centre=tip, leg=f"spoke_{k}") for k, tip in enumerate(tips)),
        turn={"wheel": spokes},
    )
    return jb.RigidScene(wheel, jb.Ground(slope=slope, g=1.0))

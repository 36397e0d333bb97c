"""Published walkers, straight-legged, kneed, with a torso, a rimless wheel; and their table.

Scenes are made with public names alone, so that a look at the walkers' names does not load JAX.
"""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jaxbiped as jb
from jaxbiped._checks import check_at_least, check_finite, check_positive, check_within

if TYPE_CHECKING:
    from jaxbiped._types import Parameter

_TWO_DEGREES, _THREE_DEGREES = math.radians(2.0), math.radians(3.0)
_FOOT_MASS = 1e-13
"""Mass of a foot, of the hip's: it swings the leg, and the hip does not feel it in 64 bits."""


def garcia(slope: "Parameter" = 0.009) -> "jb.RigidScene":
    """The simplest walking model: a mass at the hip, point feet, massless legs.

    Dimensionless: the hip's mass, the legs' length and gravity are 1, and the slope is the only
    parameter. Angles are the paper's, from the slope's normal: θ is `theta_2`, φ is `theta_2` minus
    `theta_1`.

    Source: Garcia, Chatterjee, Ruina and Coleman 1998, The simplest walking model: stability,
    complexity, and scaling, Journal of Biomechanical Engineering 120, 281.

    Args:
        slope: γ of the paper [rad]; gaits of one footstep are stable below 0.0151.

    Returns:
        The walker on rigid feet.

    Raises:
        ArgumentError: the slope is not allowed.
    """
    walker = jb.Walker(m=_FOOT_MASS, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1.0)
    return jb.RigidScene(walker, jb.Ground(slope=slope, g=1.0))


def kuo(impulse: "Parameter" = 0.04, slope: "Parameter" = 0.0) -> "jb.RigidScene":
    """The simplest walking model on level ground, pushed off along its trailing leg.

    Dimensionless like `garcia`. The push-off occurs just before the front foot strikes. The hip
    spring, with which the paper sets speed and step length independently, is left out.

    Source: Kuo 2002, Energetics of actively powered locomotion using the simplest walking model,
    Journal of Biomechanical Engineering 124, 113.

    Args:
        impulse: P̂ of the paper, the push-off [in units of the hip's mass times √(g l)].
        slope: slope of the ground [rad].

    Returns:
        The walker on rigid feet.

    Raises:
        ArgumentError: a number is not allowed.
    """
    passive = garcia(slope)
    return jb.RigidScene(passive.walker, passive.ground, (jb.actuation.PushOff(impulse),))


def goswami(
    slope: "Parameter" = _THREE_DEGREES, *, mu: "Parameter" = 2.0, beta: "Parameter" = 1.0
) -> "jb.RigidScene":
    """The compass gait: point masses on the legs and at the hip, point feet; 20 kg, legs of 1 m.

    The paper measures angles from the vertical: its θ_s is `theta_2` minus the slope, its θ_ns is
    `theta_1` minus the slope. It does not state g; its numbers agree with 9.8 m/s².

    Source: Goswami, Thuilot and Espiau 1998, A study of the passive gait of a compass-like biped
    robot: symmetry and chaos, International Journal of Robotics Research 17, 1282.

    Args:
        slope: slope of the ground [rad]; doublings of the period begin near 4.4 degrees.
        mu: mass at the hip divided by the mass of a leg, above 0 [–].
        beta: b/a, the distance of a leg's mass from the hip divided by that from the foot [–].

    Returns:
        The walker on rigid feet.

    Raises:
        ArgumentError: a number is not allowed.
    """
    check_positive("mu", mu)
    check_positive("beta", beta)
    mass = 20.0 / (2.0 + mu)
    walker = jb.Walker(m=mass, J=0.0, l=1.0, d=beta / (1.0 + beta), r=0.0, hip_mass=mu * mass)
    return jb.RigidScene(walker, jb.Ground(slope=slope, g=9.8))


def bhounsule(slope: "Parameter | None" = None, *, round_feet: bool = False) -> "jb.RigidScene":
    """The walkers of the public program passivewalker.m, with point feet or round feet.

    Dimensionless: the legs' length from the hip to the centre of a foot and gravity are 1. The
    program measures angles from the slope's normal: q1 is `theta_2`, q2 is `theta_2` − `theta_1`.

    Source: Bhounsule 2009, passivewalker.m.

    Args:
        slope: gam of the program [rad]. Default: its own value, 0.009 with point feet and 0.01
            with round feet.
        round_feet: True: feet of radius 0.2, and legs with a mass of 0.5 at half their length, for
            a hip of mass 1. False: point feet that have a leg's whole mass, 0.001 of the hip's.

    Returns:
        The walker on rigid feet.

    Raises:
        ArgumentError: the slope is not allowed.
    """
    if round_feet:
        walker = jb.Walker(m=0.5, J=0.02, l=1.2, d=0.5, r=0.2, hip_mass=1.0)
    else:
        walker = jb.Walker(m=1.0, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1000.0)
    usual = 0.01 if round_feet else 0.009
    return jb.RigidScene(walker, jb.Ground(slope=usual if slope is None else slope, g=1.0))


def wisse(
    slope: "Parameter" = _TWO_DEGREES,
    *,
    torso_mass: "Parameter" = 3.0,
    torso_height: "Parameter" = 0.3,
) -> "jb.RigidScene":
    """A compass walker with a torso that bisects the angle between its legs.

    The mechanism, a kinematic coupling at the hip, is the paper's. The numbers are not: the legs
    are those of `goswami`, and the hip and the torso together have 10 kg.

    Source: Wisse, Schwab and van der Helm 2004, Passive dynamic walking model with upper body,
    Robotica 22, 681.

    Args:
        slope: slope of the ground [rad].
        torso_mass: mass of the torso [kg].
        torso_height: height of the torso's point mass above the hip [m].

    Returns:
        The walker on rigid feet.

    Raises:
        ArgumentError: a number is not allowed.
    """
    check_within("torso_mass", torso_mass, 0.0, 10.0, open_below=True)
    check_finite("torso_height", torso_height)
    legs = jb.Walker(m=5.0, J=0.0, l=1.0, d=0.5, r=0.0, hip_mass=10.0 - torso_mass)
    walker = jb.WithTorso(legs, m_torso=torso_mass, J_torso=0.0, h=torso_height)
    return jb.RigidScene(walker, jb.Ground(slope=slope, g=9.8))


def mcgeer(slope: "Parameter | None" = None, *, knees: bool = False) -> "jb.RigidScene | jb.Scene":
    """McGeer's walkers: straight legs on rigid round feet, or legs with knees on compliant feet.

    The walker with straight legs is dimensionless: a leg's mass and length and gravity are 1. From
    the paper come the height of a leg's mass centre above the sole, 0.63, and its radius of
    gyration, 0.32; the feet have a radius of 0.3. The walker with knees has SI units, because its
    feet have the laws of contact of `seed_scene`: its proportions are scaled to legs of 0.4 m and
    a mass of 2 kg. Stops at the knees begin at 0.2 rad. Angles are the papers', from the slope's
    normal.

    Source: McGeer 1990, Passive dynamic walking, International Journal of Robotics Research 9, 62;
    McGeer 1990, Passive walking with knees, IEEE Conference on Robotics and Automation, 1640.

    Args:
        slope: slope of the ground [rad]. Default: 0.03, or the paper's 0.0456 with knees.
        knees: whether legs are thighs and shanks with stops between them.

    Returns:
        The walker, a `RigidScene` with straight legs and a `Scene` with knees.

    Raises:
        ArgumentError: the slope is not allowed.
    """
    if knees:
        # The command line's help reads this module, and does without JAX.
        from jaxbiped.scene._ready_scenes import kneed_scene

        return kneed_scene(slope=0.0456 if slope is None else slope)
    walker = jb.Walker(m=1.0, J=0.32**2, l=1.0, d=1.0 - 0.63, r=0.3, hip_mass=0.0)
    return jb.RigidScene(walker, jb.Ground(slope=0.03 if slope is None else slope, g=1.0))


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


class Model(NamedTuple):
    """A published walker.

    Attributes:
        words: description and source.
        make: its function in `jaxbiped.models`; without arguments, it returns the paper's scene.
        starts: arguments of `scene.state` for a state near each gait, by the gait's name: angles
            [rad], rates, held parts and standing feet.
        rigid: whether its scene is a `RigidScene`; otherwise it is a `Scene`.
    """

    words: str
    make: Callable[..., Any]
    starts: Mapping[str, Mapping[str, Any]]
    rigid: bool = True


def _struck(angle: float, swing: float, stance: float) -> dict[str, float]:
    """Behind a heel strike: the angle between slope's normal and stance leg, and both rates."""
    return {"theta_1": -angle, "theta_2": angle, "omega_1": swing, "omega_2": stance}


_SHORT = (0.193937369810184, -0.203866927442010)


def knees(angles: Sequence[float], rates: Sequence[float]) -> dict[str, float]:
    """Angles [rad] and rates of the bodies of two legs with knees: thigh 1, shank 1, thigh 2, …"""
    bodies = ("thigh_1", "shank_1", "thigh_2", "shank_2")
    named = {f"theta_{name}": x for name, x in zip(bodies, angles, strict=True)}
    return named | {f"omega_{name}": x for name, x in zip(bodies, rates, strict=True)}


_BENT = knees((0.14, -0.20, -0.086, 0.118), (3.4, 1.7, -0.88, -0.88))
_STRAIGHT = knees((-0.2386, -0.2386, 0.2386, 0.2386), (-0.0571, -0.0571, -1.1096, -1.1096))

MODELS: dict[str, Model] = {
    "garcia": Model(
        "the simplest walker: a mass on massless legs (Garcia et al. 1998)",
        garcia,
        {
            "long": _struck(
                0.200310900544287, -0.199832473004977 + 0.015822999948318, -0.199832473004977
            ),
            "short": _struck(_SHORT[0], _SHORT[1] * math.cos(2.0 * _SHORT[0]), _SHORT[1]),
        },
    ),
    "goswami": Model(
        "compass gait: point masses on legs and hip (Goswami et al. 1998)",
        goswami,
        {"gait": _struck(0.2710, -0.3772, -1.0918)},
    ),
    "mcgeer": Model(
        "straight legs on round feet (McGeer 1990)",
        mcgeer,
        {"gait": _struck(0.3084, -0.2807, -0.4031)},
    ),
    "mcgeer-kneed": Model(
        "legs with knees on round, compliant feet (McGeer 1990)",
        functools.partial(mcgeer, knees=True),
        {"gait": _BENT | {"standing": "shank_2"}},
        rigid=False,
    ),
    "hsu-chen": Model(
        "legs with knees that lock, on point feet (Hsu Chen 2007)",
        hsu_chen,
        {"gait": _STRAIGHT | {"held": "shank_2"}},
    ),
    "rimless-wheel": Model(
        "a wheel without a rim (McGeer 1990)",
        rimless_wheel,
        {"gait": {"theta_wheel": 3.0 * math.pi / 8.0, "omega_wheel": -0.4}},
    ),
    "wisse": Model(
        "a torso that bisects the legs' angle (Wisse et al. 2004)",
        wisse,
        {"gait": _struck(0.2645, -0.6111, -0.9789)},
    ),
    "kuo": Model(
        "the simplest walker pushing off on level ground (Kuo 2002)",
        kuo,
        {"gait": _struck(0.1946, -0.1878, -0.2030)},
    ),
    "bhounsule": Model(
        "point feet of passivewalker.m (Bhounsule 2009)",
        bhounsule,
        {
            "gait": _struck(
                0.200161072169750, -0.199906060087682 + 0.015805473227965, -0.199906060087682
            )
        },
    ),
    "bhounsule-round": Model(
        "round feet of passivewalker.m (Bhounsule 2009)",
        functools.partial(bhounsule, round_feet=True),
        {
            "gait": _struck(
                0.189472782205104, -0.239124222551699 + 0.053691703909393, -0.239124222551699
            )
        },
    ),
}
"""Published walkers by name, as commands take them."""

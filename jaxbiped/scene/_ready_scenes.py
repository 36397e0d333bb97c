"""Ready scenes: the seed paper's own, one with knees, and a ladder of fidelity of one walker."""

import dataclasses
import inspect

from jaxbiped._checks import check_choice, check_type
from jaxbiped._types import Parameter
from jaxbiped.scene._clearance import StanceRotation
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._walker import Kneed, Walker
from jaxbiped.scene.laws.friction._bristles import LuGre
from jaxbiped.scene.laws.friction._coulomb import RegularisedCoulomb
from jaxbiped.scene.laws.friction._stribeck import BengisuAkay
from jaxbiped.scene.laws.normal._ristow_schafer import RistowSchafer


def seed_scene(
    *,
    slope: float = 0.02,
    g: float = 9.8,
    m: float = 1.0,
    J: float = 0.0096,
    l: float = 0.40,
    d: float = 0.10,
    r: float = 0.08,
    hip_mass: float = 0.0,
    n: float = 1.5,
    K: float = 1e6,
    c: float = 1e7,
    mu_static: float = 0.50,
    mu_kinetic: float = 0.40,
    v0: float = 1e-4,
    xi: float = 1000.0,
    **unknown: float,
) -> Scene:
    """The paper's walker (section 2.3) on its slope; every parameter can be set by its name.

    The paper prints slopes such as "0,20 rad"; 0.02 rad is meant.

    Args:
        slope: inclination of the ground [rad].
        g: gravitational acceleration [m/s²].
        m: mass of a leg [kg].
        J: inertia of a leg about its centre of mass [kg·m²].
        l: length of a leg, hip to sole [m].
        d: distance of a leg's centre of mass from the hip [m].
        r: radius of a foot [m].
        hip_mass: mass at the hip [kg].
        n: exponent of the normal force [–].
        K: contact stiffness [N/mⁿ].
        c: contact damping [N·s/m²].
        mu_static, mu_kinetic: static and kinetic friction coefficients [–].
        v0: slip speed at which friction peaks [m/s].
        xi: rate at which friction falls above v0 [s/m].
        unknown: not used; any other name is refused.

    Returns:
        The scene, made of `Walker`, `Ground`, `RistowSchafer` and `BengisuAkay`, with the paper's
        clearance rule.

    Raises:
        ArgumentError: a value is not allowed, or a name is not known; the message names it.

    Examples:
        >>> import jaxbiped as jb
        >>> float(jb.seed_scene(slope=0.03).ground.slope)
        0.03
    """
    for name in unknown:
        check_choice("parameter", name, list(inspect.signature(seed_scene).parameters)[:-1])
    return Scene(
        walker=Walker(m=m, J=J, l=l, d=d, r=r, hip_mass=hip_mass),
        ground=Ground(slope=slope, g=g),
        normal=RistowSchafer(K=K, c=c, n=n),
        friction=BengisuAkay(mu_static=mu_static, mu_kinetic=mu_kinetic, v0=v0, xi=xi),
        clearance=StanceRotation(),
    )


_CREEP = 1e-3
"""Slip speed of the friction without slip cost [m/s]: a stance foot creeps at less than it."""
_BRISTLE_DAMPING = 100.0
"""Damping of the bristles [s/m]: they settle without ringing under a leg of some kilograms."""


def kneed_scene(*, slope: Parameter = 0.0456) -> Scene:
    """McGeer's walker with knees on the seed's ground, scaled to legs of 0.4 m and 2 kg in all.

    Of length and mass: thighs 0.46 and 0.1, shanks 0.54 and 0.062, feet of a radius of 0.2. Radii
    of gyration are 0.135 and 0.186 of the length, and 68 % of the mass are at the hip.

    Source: McGeer 1990, Passive walking with knees, IEEE Conference on Robotics and Automation.
    """
    walker = Kneed(
        m_thigh=0.2,
        J_thigh=5.8e-4,
        l_thigh=0.184,
        d_thigh=0.080,
        m_shank=0.124,
        J_shank=6.9e-4,
        l_shank=0.216,
        d_shank=0.096,
        w_shank=-0.004,
        r=0.08,
        hip_mass=1.352,
        epsilon=0.2,
        stop=RistowSchafer(K=300.0, c=3000.0, n=1.0),
    )
    seed = seed_scene(slope=slope)
    return Scene(walker, seed.ground, seed.normal, seed.friction)


def ladder(scene: Scene | None = None) -> dict[str, Scene | RigidScene]:
    """Four scenes of one walker, the cheapest first.

    - rigid: rigid feet, without contact laws.
    - creep: compliant feet, friction without a peak, spread over a slip of 1 mm/s.
    - stribeck: the scene itself.
    - bristles: friction whose bristles bend by 0.01 mm before the foot slips.

    Args:
        scene: the walker with its laws. Default: the seed's scene.

    Returns:
        The scenes under the names "rigid", "creep", "stribeck" and "bristles", in this order.

    Raises:
        ArgumentError: the scene's friction is not `BengisuAkay`, from which the other laws are
            derived.

    Examples:
        >>> import jaxbiped as jb
        >>> list(jb.ladder())
        ['rigid', 'creep', 'stribeck', 'bristles']
    """
    scene = seed_scene() if scene is None else scene
    check_type("scene", scene, Scene)
    law = scene.friction
    check_type("scene.friction", law, BengisuAkay)
    assert isinstance(law, BengisuAkay)
    bristles = dataclasses.replace(LuGre.like_seed(law), sigma_1=_BRISTLE_DAMPING)
    creep = RegularisedCoulomb(mu=law.mu_kinetic, v_d=_CREEP)
    return {
        "rigid": RigidScene(walker=scene.walker, ground=scene.ground),
        "creep": dataclasses.replace(scene, friction=creep),
        "stribeck": scene,
        "bristles": dataclasses.replace(scene, friction=bristles),
    }

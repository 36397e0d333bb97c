"""McGeer's walkers on round feet: with straight legs, and with knees."""

from typing import TYPE_CHECKING

import jaxbiped as jb

if TYPE_CHECKING:
    from jaxbiped._types import Parameter


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
        seed = jb.seed_scene(slope=0.0456 if slope is None else slope)
        return jb.Scene(_kneed(), seed.ground, seed.normal, seed.friction)
    walker = jb.Walker(m=1.0, J=0.32**2, l=1.0, d=1.0 - 0.63, r=0.3, hip_mass=0.0)
    return jb.RigidScene(walker, jb.Ground(slope=0.03 if slope is None else slope, g=1.0))


def _kneed() -> "jb.Kneed":
    """Of length and mass: thighs 0.46 and 0.1, shanks 0.54 and 0.062, feet of a radius of 0.2.

    Radii of gyration are 0.135 and 0.186 of the length, and 68 % of the mass are at the hip.
    """
    return jb.Kneed(
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
        stop=jb.laws.RistowSchafer(K=300.0, c=3000.0, n=1.0),
    )

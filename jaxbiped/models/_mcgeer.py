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
        # The command line's help reads this module, and does without JAX.
        from jaxbiped.scene._ready_scenes import kneed_scene

        return kneed_scene(slope=0.0456 if slope is None else slope)
    walker = jb.Walker(m=1.0, J=0.32**2, l=1.0, d=1.0 - 0.63, r=0.3, hip_mass=0.0)
    return jb.RigidScene(walker, jb.Ground(slope=0.03 if slope is None else slope, g=1.0))

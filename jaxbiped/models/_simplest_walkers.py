"""The simplest walker: a mass on massless legs, going down a slope or pushing off on level ground.

Scenes are made with public names alone, so that a look at the walkers' names does not load JAX.
"""

from typing import TYPE_CHECKING

import jaxbiped as jb

if TYPE_CHECKING:
    from jaxbiped._types import Parameter

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

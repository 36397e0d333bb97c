"""Weight on a normal law: its parameters from how a mass stands on it."""

from typing import Any

import jax.numpy as jnp

from jaxbiped._checks import check_at_least, check_not_negative, check_positive
from jaxbiped._types import Parameter, Scalar, as_float


def matched_to_weight(
    *,
    mass: Parameter,
    penetration: Parameter,
    g: Parameter,
    damping_ratio: Parameter = 0.0,
    n: Parameter = 1.5,
) -> tuple[Scalar, Scalar]:
    """The stiffness K and the damper d that hold a mass at rest as told.

    K δⁿ carries the weight m g at the penetration δ. There the linear stiffness is
    k = dF/dδ = n m g/δ, and the linear damper is d = dF/dδ̇ = 2 ζ √(k m).

    Args:
        mass: what stands on the law, m [kg].
        penetration: how deep it stands, δ [m].
        g: gravitational acceleration [m/s²].
        damping_ratio: of small oscillations about that, ζ [–].
        n: exponent of the stiffness [–].

    Returns:
        K [N/mⁿ] and d [N·s/m].

    Raises:
        ArgumentError: mass, penetration or g not above 0, damping_ratio below 0 or n below 1.
    """
    mass, penetration, g, damping_ratio, n = (
        as_float(value) for value in (mass, penetration, g, damping_ratio, n)
    )
    check_positive("mass", mass, "kg")
    check_positive("penetration", penetration, "m")
    check_positive("g", g, "m/s^2")
    check_not_negative("damping_ratio", damping_ratio)
    check_at_least("n", n, "1", 1.0)
    weight: Any = mass * g
    slope = n * weight / penetration
    return weight / penetration**n, 2.0 * damping_ratio * jnp.sqrt(slope * mass)

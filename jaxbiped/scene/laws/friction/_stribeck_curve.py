"""The Stribeck curve: how the coefficient of friction falls from static to kinetic."""

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.scene.laws._abstract_laws import power


def stribeck_coefficient(
    mu_static: Scalar, mu_kinetic: Scalar, v_s: Scalar, p: Scalar, slip_speed: Scalar
) -> Scalar:
    """mu_kinetic + (mu_static − mu_kinetic) exp(−(|V_T|/v_s)^p) [–], at rest mu_static.

    Even in V_T. Its slope at rest is reported as zero, which is what matters in a product with
    a factor that vanishes there: for p < 1 it has none.
    """
    speed = jnp.abs(slip_speed)
    slips = speed > 0.0
    fallen = power(jnp.where(slips, speed, v_s) / v_s, p)
    decay = jnp.where(slips, jnp.exp(-fallen), 1.0)
    return mu_kinetic + (mu_static - mu_kinetic) * decay


def stribeck_switches(p: Scalar, slip_speed: Scalar) -> tuple[Scalar, ...]:
    """Rest, where V_T times the curve has a corner in its first derivative: for p up to 1.

    For a steeper p there is none, and the function that is returned has no zero.
    """
    return (jnp.where(p <= 1.0, slip_speed, 1.0),)

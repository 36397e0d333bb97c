"""Sine, cosine and the angle of a vector from plain arithmetic, which becomes vector instructions.

XLA's CPU backend calls the C library for each 64-bit sine or cosine, one lane at a time: 8 ns
each where a multiplication takes 0.2, and the largest part of a step. This pair shares one
argument reduction and vectorises.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jax.lax import add, mul, sub

from jaxbiped._types import Scalar

# Two parts of π/2: the first has 33 bits, so that its product with a quadrant's number is exact.
_HALF_PI_HIGH = 1.57079632673412561417e00
_HALF_PI_LOW = 6.07710050650619224932e-11
SINE_SERIES = (
    1.58969099521155010221e-10,
    -2.50507602534068634195e-08,
    2.75573137070700676789e-06,
    -1.98412698298579493134e-04,
    8.33333333332248946124e-03,
    -1.66666666666666324348e-01,
)
COSINE_SERIES = (
    -1.13596475577881948265e-11,
    2.08757232129817482790e-09,
    -2.75573143513906633035e-07,
    2.48015872894767294178e-05,
    -1.38888888888741095749e-03,
    4.16666666666666019037e-02,
)
"""Minimax coefficients on [−π/4, π/4], highest power first (FreeBSD's msun, k_sin.c, k_cos.c)."""


@jax.custom_jvp
def sine_cosine(angle: Scalar) -> tuple[Scalar, Scalar]:
    """Sine and cosine of an angle [rad]; errors below 2e-16 up to |angle| = 1e5."""
    if jnp.result_type(angle) != jnp.float64:
        return jnp.sin(angle), jnp.cos(angle)
    # The primitives themselves: NumPy's operators take several times as long to trace.
    angle = jnp.asarray(angle)
    quadrant = jnp.round(mul(angle, 2.0 / jnp.pi))
    rest = sub(sub(angle, mul(quadrant, _HALF_PI_HIGH)), mul(quadrant, _HALF_PI_LOW))
    square = mul(rest, rest)
    series = _polynomial(SINE_SERIES, square)
    sine = add(rest, mul(mul(rest, square), series))
    polynomial = _polynomial(COSINE_SERIES, square)
    cosine = sub(1.0, sub(mul(0.5, square), mul(mul(square, square), polynomial)))
    number = quadrant.astype(jnp.int32)
    odd = (number & 1) != 0
    back = (number & 2) != 0
    first, second = jnp.where(odd, cosine, sine), jnp.where(odd, sine, cosine)
    return jnp.where(back, -first, first), jnp.where(back ^ odd, -second, second)


def _polynomial(coefficients: Sequence[float], x: Scalar) -> Scalar:
    total = jnp.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        total = add(mul(total, x), coefficient)
    return total


@sine_cosine.defjvp
def _sine_cosine_jvp(
    primals: tuple[Scalar], tangents: tuple[Scalar]
) -> tuple[tuple[Scalar, Scalar], tuple[Scalar, Scalar]]:
    sine, cosine = sine_cosine(primals[0])
    return (sine, cosine), (cosine * tangents[0], -sine * tangents[0])


@jax.custom_jvp
def angle_of_vector(y: Scalar, x: Scalar) -> Scalar:
    """The angle of (x, y) from the axis of x [rad], between −π and π; its error is below 1e-15."""
    width, height = jnp.abs(x), jnp.abs(y)
    steep = height > width
    ratio = jnp.where(steep, width / height, height / width)
    guess = ratio * (0.25 * jnp.pi + 0.273 * (1.0 - ratio))  # off by at most 0.004
    guess = jnp.where(steep, 0.5 * jnp.pi - guess, guess)
    guess = jnp.where(x < 0.0, jnp.pi - guess, guess)
    guess = jnp.where(y < 0.0, -guess, guess)
    sine, cosine = sine_cosine(guess)
    # The sine of what the guess lacks, and the series of the arcsine.
    off = (y * cosine - x * sine) / jnp.sqrt(x * x + y * y)
    square = off * off
    return guess + off * (1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0)))


@angle_of_vector.defjvp
def _angle_of_vector_jvp(
    primals: tuple[Scalar, Scalar], tangents: tuple[Scalar, Scalar]
) -> tuple[Scalar, Scalar]:
    y, x = primals
    dy, dx = tangents
    return angle_of_vector(y, x), (x * dy - y * dx) / (x * x + y * y)

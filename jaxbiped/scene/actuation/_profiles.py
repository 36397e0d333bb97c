"""Profiles of a torque over a phase or an angle: a pulse and a cubic spline."""

import jax.numpy as jnp

from jaxbiped._checks import ArgumentError, check_finite, holds_somewhere
from jaxbiped._types import Scalar

_DIFFERENCE = (1.0 / 6.0, -4.0 / 6.0, 1.0, -4.0 / 6.0, 1.0 / 6.0)


def pulse(height: Scalar, centre: Scalar, width: Scalar, place: Scalar) -> Scalar:
    """height exp(−((place − centre)/width)²)."""
    off = (place - centre) / width
    return height * jnp.exp(-off * off)


def check_spline(coefficients: tuple[Scalar, ...], first: Scalar, last: Scalar) -> None:
    """Raises `ArgumentError` for fewer than two coefficients, or a last place not above the first.

    The coefficients are those of a field `torque`.
    """
    if len(coefficients) < 2:
        raise ArgumentError(
            f"torque has length {len(coefficients)}, which is not allowed: give two or more "
            "coefficients."
        )
    check_finite("first", first)
    check_finite("last", last)
    if holds_somewhere(last <= first):
        raise ArgumentError(f"last = {last} is not allowed with first = {first}: it must be above.")


def cubic_spline(
    coefficients: tuple[Scalar, ...], first: Scalar, last: Scalar, place: Scalar
) -> Scalar:
    """Σ c_i B(place/h − i), cubic B-splines at n places of equal distance h, first to last.

    Source: de Boor, A Practical Guide to Splines (2001), chapter IX.
    """
    count = len(coefficients)
    at = (place - first) * (count - 1) / (last - first)
    cubes = []
    for j in range(count + 4):
        beyond = jnp.maximum(at + (2.0 - j), 0.0)
        cubes.append(beyond * beyond * beyond)
    splines = (
        sum(weight * cubes[i + j] for j, weight in enumerate(_DIFFERENCE)) for i in range(count)
    )
    return jnp.asarray(sum(a * b for a, b in zip(coefficients, splines, strict=True)))

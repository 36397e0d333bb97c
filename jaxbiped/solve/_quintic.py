"""Quintic Hermite interpolation through both ends of a step."""

import functools
import operator
from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar

_NEWTON = 3
"""Newton steps on its root."""


class Quintic(NamedTuple):
    """Hermite's quintic of the opening over a step, by its coefficients."""

    coefficients: tuple[Scalar, ...]

    @staticmethod
    def of(step: Scalar, old: tuple[Scalar, ...], new: tuple[Scalar, ...]) -> "Quintic":
        """From values, rates and second derivatives at both ends."""
        rise = new[0] - old[0]
        p, q = step * old[1], step * new[1]
        a, b = 0.5 * step * step * old[2], 0.5 * step * step * new[2]
        return Quintic(
            (
                old[0],
                p,
                a,
                10.0 * rise - 6.0 * p - 4.0 * q - 3.0 * a + b,
                -15.0 * rise + 8.0 * p + 7.0 * q + 3.0 * a - 2.0 * b,
                6.0 * rise - 3.0 * (p + q) - a + b,
            )
        )

    def value(self, x: Scalar) -> Scalar:
        """At a share `x` of the step."""
        return self._value_and_slope(x)[0]

    def root(self) -> Scalar:
        """The share of the step at which it falls through zero, roughly.

        Where Newton's method leaves the part that is known to hold it, that is halved: beside the
        strike the curve may have a root behind it, at which the legs opened.
        """
        end = functools.reduce(operator.add, self.coefficients)
        rise = end - self.coefficients[0]
        x = -self.coefficients[0] / jnp.where(rise == 0.0, 1.0, rise)
        low, high = jnp.zeros_like(x), jnp.ones_like(x)
        for _ in range(_NEWTON):
            value, slope = self._value_and_slope(x)
            low, high = jnp.where(value > 0.0, x, low), jnp.where(value > 0.0, high, x)
            newton = x - value / jnp.where(slope == 0.0, 1.0, slope)
            inside = (slope < 0.0) & (newton >= low) & (newton <= high)
            x = jnp.where(inside, newton, 0.5 * (low + high))
        return x

    def _value_and_slope(self, x: Scalar) -> tuple[Scalar, Scalar]:
        value, slope = self.coefficients[-1], jnp.zeros_like(self.coefficients[-1])
        for coefficient in self.coefficients[-2::-1]:
            slope = slope * x + value
            value = value * x + coefficient
        return value, slope

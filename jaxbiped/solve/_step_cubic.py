"""Cubic of a switch's value over a step: where it changes sign, and where it turns.

By the value and its rate at both ends (Hermite's), with the step's own length as unit of time.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar

_BISECTIONS = 40
_NEAR = 0.1
"""Value at a turning point, in units of the smaller one of both ends, from which the cubic may be
wrong about its sign."""


class StepCubic(NamedTuple):
    """Cubics of values on (0, 1); leaves of one shape.

    Attributes:
        start, end: values at both ends.
        start_slope, end_slope: their derivatives there.
    """

    start: Scalar
    end: Scalar
    start_slope: Scalar
    end_slope: Scalar

    def at(self, place: Scalar) -> Scalar:
        """The value at a place."""
        second, third = self._bends()
        return self.start + place * (self.start_slope + place * (second + place * third))

    def sign_change(self) -> Scalar:
        """Where it changes sign: the upper end of the last bracket, which lies past the change."""

        def halve(_: Scalar, ends: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
            lower, upper = ends
            middle = 0.5 * (lower + upper)
            unchanged = (self.at(middle) > 0.0) == (self.start > 0.0)
            return jnp.where(unchanged, middle, lower), jnp.where(unchanged, upper, middle)

        ends = (jnp.zeros_like(self.start), jnp.ones_like(self.start))
        return jax.lax.fori_loop(0, _BISECTIONS, halve, ends)[1]

    def turns(self) -> Scalar:
        """Whether its slope changes sign (booleans)."""
        return (self.start_slope != 0.0) & (self.start_slope * self.end_slope <= 0.0)

    def turning_point(self) -> Scalar:
        """Where its slope changes sign; 1 where it does not."""
        second, third = self._bends()
        steep = jnp.abs(self.start_slope)
        second, third = (jnp.where(self.start_slope > 0.0, -each, each) for each in (second, third))
        root = jnp.sqrt(jnp.maximum(second * second + 3.0 * third * steep, 0.0))
        # The one at which a slope that begins below zero rises.
        below = second + root
        inside = self.turns() & (below > steep)
        return jnp.where(inside, steep / jnp.where(inside, below, 1.0), 1.0)

    def may_touch(self) -> Scalar:
        """Whether, of one sign at both ends, it falls so low that it may reach zero (booleans)."""
        side = jnp.where(self.start > 0.0, 1.0, -1.0)
        approaches = (side * self.start_slope < 0.0) & (side * self.end > 0.0) & self.turns()
        lowest = side * self.at(self.turning_point())
        return approaches & (lowest < _NEAR * jnp.minimum(side * self.start, side * self.end))

    def _bends(self) -> tuple[Scalar, Scalar]:
        """Coefficients of the second and of the third power."""
        second = 3.0 * (self.end - self.start) - 2.0 * self.start_slope - self.end_slope
        third = 2.0 * (self.start - self.end) + self.start_slope + self.end_slope
        return second, third

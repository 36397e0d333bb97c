"""Polynomials of a quantity over a step, from what is known at both ends (Hermite's).

A cubic takes values and rates, with the step's own length as unit of time. A quintic takes second
derivatives as well, in Bernstein's form: its control values bound it, and it changes sign at most
as often as they do (Descartes' rule), by an even number less if less often.
"""

import functools
import itertools
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar

_BISECTIONS = 40
_NEAR = 0.1
"""Value at a turning point, in units of the smaller one of both ends, from which the cubic may be
wrong about its sign."""
_NEWTON = 3
"""Newton steps on its root."""


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


class Quintic(NamedTuple):
    """Hermite's quintic of a quantity over a step.

    Attributes:
        control: its six control values, the first and the last one those at both ends.
    """

    control: tuple[Scalar, ...]

    @staticmethod
    def of(step: Scalar, old: tuple[Scalar, ...], new: tuple[Scalar, ...]) -> "Quintic":
        """From values, rates and second derivatives at both ends."""
        p, q = 0.2 * step * old[1], 0.2 * step * new[1]
        square = 0.05 * step * step
        return Quintic(
            (
                old[0],
                old[0] + p,
                old[0] + 2.0 * p + square * old[2],
                new[0] - 2.0 * q + square * new[2],
                new[0] - q,
                new[0],
            )
        )

    def sign_changes(self, shift: Scalar, *, from_second: Scalar) -> Scalar:
        """How often the control values change sign, all but both ends' higher by `shift`.

        `from_second`: whether the first one counts as having the second one's sign.
        """
        first, *inner, last = self.control
        above = [first > 0.0, *[value + shift > 0.0 for value in inner], last > 0.0]
        above[0] = jnp.where(from_second, self.control[1] > 0.0, above[0])
        changes = [jnp.where(a != b, 1, 0) for a, b in itertools.pairwise(above)]
        return functools.reduce(operator.add, changes)

    def derivatives(self, x: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """Value, slope and curvature at a share `x` of the step."""
        coefficients = self._coefficients()
        value, slope, half = coefficients[-1], jnp.zeros_like(x), jnp.zeros_like(x)
        for coefficient in coefficients[-2::-1]:
            half = half * x + slope
            slope = slope * x + value
            value = value * x + coefficient
        return value, slope, 2.0 * half

    def root(self) -> Scalar:
        """The share of the step at which it falls through zero, roughly, where it does so once.

        Where Newton's method leaves the part that is known to hold it, that is halved.
        """
        rise = self.control[-1] - self.control[0]
        x = -self.control[0] / jnp.where(rise == 0.0, 1.0, rise)
        low, high = jnp.zeros_like(x), jnp.ones_like(x)
        for _ in range(_NEWTON):
            value, slope, _ = self.derivatives(x)
            low, high = jnp.where(value > 0.0, x, low), jnp.where(value > 0.0, high, x)
            newton = x - value / jnp.where(slope == 0.0, 1.0, slope)
            inside = (slope < 0.0) & (newton >= low) & (newton <= high)
            x = jnp.where(inside, newton, 0.5 * (low + high))
        return x

    def _coefficients(self) -> tuple[Scalar, ...]:
        """Of the powers of the share of the step, the lowest first."""
        row, found = list(self.control), [self.control[0]]
        for binomial in (5.0, 10.0, 10.0, 5.0, 1.0):
            row = [b - a for a, b in itertools.pairwise(row)]
            found.append(binomial * row[0])
        return tuple(found)

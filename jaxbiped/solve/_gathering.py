"""Gathering: resets of the state that follow each other ever faster, or leave it where it was."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Numbers, Scalar

_NEAR, _MANY = 1e-6, 8
"""Time between resets that gather, in the system's unit, and how many of them are too many."""


class Gathering(NamedTuple):
    """Resets of a motion so far.

    Attributes:
        last: time of the last one [s].
        followed: how many have followed each other within a short time.
    """

    last: Scalar
    followed: Scalar

    @classmethod
    def none(cls, like: Numbers) -> "Gathering":
        """Before the first reset."""
        return cls(jnp.full_like(like, -jnp.inf), jnp.zeros((), dtype=jnp.int64))

    @property
    def chatters(self) -> Scalar:
        """Whether too many gather for the motion to go on (boolean)."""
        return self.followed >= _MANY

    def after(self, met: Scalar, t: Scalar, repeats: Scalar, unit: float) -> "Gathering":
        """The same behind an attempt.

        Args:
            met: whether it ended in a reset (boolean).
            t: its end [s].
            repeats: whether the reset left the state where it is reset (boolean).
            unit: the system's unit of time [s].
        """
        near = t - self.last < _NEAR * unit
        count = jnp.where(repeats, _MANY, jnp.where(near, self.followed + 1, 0))
        return Gathering(jnp.where(met, t, self.last), jnp.where(met, count, self.followed))

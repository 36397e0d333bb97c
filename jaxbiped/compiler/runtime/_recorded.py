"""Recorded steps: what simulations recorded."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxbiped._types import Numbers


class Recorded(NamedTuple):
    """What was recorded of n simulations.

    Attributes:
        values: shape (n, room, numbers in a record). Beyond the records there are NaN where a
            schedule says when they are due, else zeros: memory that nobody ever touched.
        counts: how many records there were, shape (n,); more than `room` are lost.
    """

    values: np.ndarray
    counts: np.ndarray

    @property
    def room(self) -> int:
        """For how many records there was room."""
        return int(self.values.shape[-2])

    def columns(self, first: Numbers) -> list[Array]:
        """Of one simulation, as `Recording.columns`."""
        known = jnp.arange(self.room) < self.counts
        rows = jnp.where(known[:, None], self.values, jnp.nan)
        return list(jnp.concatenate([jnp.asarray(first)[None], rows]).T)

"""Given starts."""

import hashlib

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import JsonObject
from jaxbiped.dynamics._state import BristleState, RigidState, State
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep.starts._starts import AbstractStarts, Batch


class GivenStarts(AbstractStarts):
    """Starts as they are given.

    Attributes:
        states: `State`, `BristleState` or `RigidState` with leaves of shape (n,).

    Raises:
        ArgumentError: a state of another kind, or leaves of different shapes.
    """

    states: PyTree

    def __check_init__(self) -> None:
        check_type("states", self.states, State, BristleState, RigidState)
        shapes = {np.shape(leaf) for leaf in self.states}
        if len(shapes) > 1 or len(shapes.pop()) != 1:
            shown = sorted({np.shape(leaf) for leaf in self.states})
            raise ArgumentError(f"states has leaves of shapes {shown}: all of them must be (n,).")

    @property
    def shape(self) -> tuple[int, ...]:
        return (len(self.states.hip_x),)

    @property
    def axes(self) -> dict[str, np.ndarray | None]:
        return {"start": None}

    @property
    def own_columns(self) -> tuple[str, ...]:
        return tuple(self.states._fields)

    def at(self, labelling: Labelling, numbers: np.ndarray) -> Batch:
        states = jtu.tree_map(lambda leaf: np.asarray(leaf, np.float64)[numbers], self.states)
        return Batch(states, {}, states._asdict())

    def described(self) -> JsonObject:
        digest = hashlib.sha256()
        for leaf in self.states:
            digest.update(np.ascontiguousarray(leaf, dtype=np.float64).tobytes())
        return {"given": self.size, "sha256": digest.hexdigest()}

    def between(self, first: int, last: int) -> "GivenStarts":
        """Those from number `first` up to `last` alone."""
        return GivenStarts(jtu.tree_map(lambda leaf: np.asarray(leaf)[first:last], self.states))

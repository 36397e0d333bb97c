"""Origin of a gait: how a search came to it, and what else it saw."""

import enum
from typing import NamedTuple

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.dynamics._state import WalkerState
from jaxbiped.gait._homotopy import BranchEnd
from jaxbiped.scene._scene import AbstractScene

MOST_OTHERS = 4
"""Other gaits that there is room for."""


class FoundBy(enum.IntEnum):
    """The stage of the search that came to a gait. `str(found_by)` is its name in words.

    - guess: Newton's method from the guess that was given.
    - start: Newton's method from the seed's start, fitted to the scene.
    - walking: walks forwards from many starts.
    - continuation: the gait of the seed's scene, followed to this one.
    - scattered starts: Newton's method from scattered starts.
    """

    GUESS = 0
    START = 1
    WALKING = 2
    CONTINUATION = 3
    SCATTERED_STARTS = 4

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


class OtherGait(NamedTuple):
    """A gait that was seen, but is not the one returned.

    Attributes:
        period: duration of its cycle [s].
        step_length: advance along the slope in a cycle [m].
        spectral_radius: largest absolute value of a Floquet multiplier.
        state: its state on the section.
    """

    period: Scalar
    step_length: Scalar
    spectral_radius: Scalar
    state: WalkerState


class Origin(NamedTuple):
    """How a search came to a gait; under `vmap` every array gains the batch's axes.

    Attributes:
        found_by: code of a `FoundBy`.
        others: other gaits that were seen, by their radius, leaves of shape (4,), NaN beyond the
            last.
        branch_end: code of a `BranchEnd`: how the branch of the seed's gait ended on its way to
            the scene, where it was followed.
        branch_walk_ending: code of the `Ending` of the walk by which it ended.
        nearest: the scene on that branch nearest to the one asked for that has a gait, NaN where
            none was followed.
    """

    found_by: Scalar
    others: OtherGait
    branch_end: Scalar
    branch_walk_ending: Scalar
    nearest: AbstractScene


def single_stage_origin(scene: AbstractScene, start: WalkerState, found_by: FoundBy) -> Origin:
    """Of a search that had but one stage."""
    missing: PyTree = np.full(MOST_OTHERS, np.nan)
    return Origin(
        found_by=code_array(found_by),
        others=OtherGait(missing, missing, missing, jtu.tree_map(lambda _: missing, start)),
        branch_end=code_array(BranchEnd.NOT_FOLLOWED),
        branch_walk_ending=code_array(0),
        nearest=jtu.tree_map(lambda leaf: np.full(np.shape(leaf), np.nan), scene),
    )


def code_array(code: int) -> PyTree:
    """A code as an array, made by NumPy: JAX would take longer."""
    return np.asarray(int(code))

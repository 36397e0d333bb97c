"""Force samples on times fit for drawing: fine enough about each peak."""

import jax.tree_util as jtu
import numpy as np

from jaxbiped.dynamics._contacts import Contacts, contacts
from jaxbiped.measure._samples import evaluate_along, evaluate_at
from jaxbiped.plot._samples import sample
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._trajectory import Trajectory

_ROUNDS = 3
_PARTS = 8
"""Into which the intervals beside an extreme are split in each round: 512 in all."""
_FLOOR = 1e-3
"""Extremes below this part of the largest force of their kind are too small to be seen."""


def sampled_forces(
    scene: Scene,
    trajectory: Trajectory,
    *,
    start: float | None = None,
    stop: float | None = None,
) -> tuple[np.ndarray, Contacts]:
    """Times [s] of shape (n,) between two times, and the contacts at them, leaves (n,).

    The solver's steps follow the state, which does not feel how sharp a peak of the force is:
    where slip passes the peak of friction, the force has a corner and then loses two thirds of
    itself within half a microsecond, less than a step. So the intervals on both sides of every
    local extreme of a force are split again and again, until peaks no longer depend on where
    the steps happen to end.

    Raises:
        ValueError: the trajectory was not saved step by step.
    """
    samples = sample(trajectory, start=start, stop=stop)
    t, found = samples.t, evaluate_along(scene, samples.state, contacts)
    for _ in range(_ROUNDS):
        times = _beside_extremes(t, found)
        if not times.size:
            break
        more = evaluate_at(scene, trajectory, contacts, times)
        t, order = np.unique(np.concatenate([t, times]), return_index=True)
        found = jtu.tree_map(
            lambda old, new, order=order: np.concatenate([old, new])[order], found, more
        )
    return t, found


def _beside_extremes(t: np.ndarray, found: Contacts) -> np.ndarray:
    """Times that split the intervals beside the extremes of any force."""
    split = np.zeros(len(t) - 1, dtype=bool)
    for kind in zip(*found.forces, strict=True):
        forces = [np.asarray(force) for force in kind if force is not None]
        largest = max((float(np.max(np.abs(force))) for force in forces), default=0.0)
        for force in forces:
            rises = np.diff(force)
            turns = rises[:-1] * rises[1:] < 0.0
            turns &= np.abs(force[1:-1]) > _FLOOR * largest
            split[:-1] |= turns
            split[1:] |= turns
    # Nothing lies between two neighbours among the floating-point numbers.
    split &= np.diff(t) > 64.0 * _PARTS * np.spacing(t[-1])
    left, width = t[:-1][split], np.diff(t)[split]
    return np.ravel(left[:, None] + width[:, None] * np.arange(1, _PARTS) / _PARTS)

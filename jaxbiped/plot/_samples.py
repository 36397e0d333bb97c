"""Samples of a trajectory on times fit for drawing: even ones, solver steps, force peaks."""

from typing import NamedTuple

import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt

from jaxbiped.dynamics._contacts import Contacts, contacts
from jaxbiped.dynamics._state import State
from jaxbiped.measure._samples import evaluate_along, evaluate_at
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._trajectory import Trajectory

_EVEN = 2048
"""Evenly spaced times; a fixed number, so that evaluating them compiles once."""


class Samples(NamedTuple):
    """A motion at increasing times: `t` [s] of shape (n,), NumPy leaves of shape (n,)."""

    t: np.ndarray
    state: State


def end_time(trajectory: Trajectory) -> float:
    """Time of the last state [s]; raises `ValueError` for a batch, or no step by step motion."""
    trajectory.require_dense()
    return float(np.asarray(trajectory.t)[-1])


def state_at(trajectory: Trajectory, t: npt.ArrayLike) -> State:
    """States at times [s], as NumPy arrays."""
    return jtu.tree_map(np.asarray, trajectory.at(t))


def sample(
    trajectory: Trajectory, *, start: float | None = None, stop: float | None = None
) -> Samples:
    """Every step of the solver between two times [s], and 2048 evenly spaced times.

    The steps crowd where the motion is fast (a heel strike lasts a millisecond), the even times
    fill in where they are far apart. Raises `ValueError` where the steps were not saved.
    """
    last = end_time(trajectory)
    start = 0.0 if start is None else max(start, 0.0)
    stop = last if stop is None else min(stop, last)
    even = np.linspace(start, stop, _EVEN)
    filled = state_at(trajectory, even)
    steps = np.asarray(trajectory.t)
    inside = (steps > start) & (steps < stop)
    t, order = np.unique(np.concatenate([even, steps[inside]]), return_index=True)
    state = jtu.tree_map(
        lambda a, b: np.concatenate([a, np.asarray(b)[inside]])[order], filled, trajectory.state
    )
    return Samples(t, state)


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

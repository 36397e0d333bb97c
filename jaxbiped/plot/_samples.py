"""Samples of a trajectory on times fit for drawing: the solver's own steps and even ones."""

from typing import NamedTuple

import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt

from jaxbiped.dynamics._state import State
from jaxbiped.solve._trajectory import Trajectory

_EVEN = 2048
"""Evenly spaced times; a fixed number, so that evaluating them compiles once."""


class Samples(NamedTuple):
    """A motion at increasing times: `t` [s] of shape (n,), NumPy leaves of shape (n,)."""

    t: np.ndarray
    state: State


def end_time(trajectory: Trajectory) -> float:
    """Time of the last state [s].

    Raises:
        ValueError: the trajectory was not saved step by step, or this is a batch.
    """
    trajectory.require_dense()
    return float(np.asarray(trajectory.t)[-1])


def state_at(trajectory: Trajectory, t: npt.ArrayLike) -> State:
    """States at times [s], as NumPy arrays.

    Raises:
        ValueError: the trajectory was not saved step by step.
    """
    return jtu.tree_map(np.asarray, trajectory.at(t))


def sample(
    trajectory: Trajectory, *, start: float | None = None, stop: float | None = None
) -> Samples:
    """Every step of the solver between two times [s], and 2048 evenly spaced times.

    The steps crowd where the motion is fast (a heel strike lasts a millisecond), the even times
    fill in where they are far apart.

    Raises:
        ValueError: the trajectory was not saved step by step.
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

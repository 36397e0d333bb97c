"""Recorded steps of a solve by lanes, as a trajectory's."""

from collections.abc import Callable
from typing import NamedTuple

import diffrax
import jax
import numpy as np
from jaxtyping import Array

from jaxbiped.dynamics._state import State
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock


class RecordedSteps(NamedTuple):
    """The times [s] of a start and of n steps' ends, (n + 1,), the states there, and the rest."""

    t: Array
    state: State
    dense: diffrax.DenseInterpolation


def recorded_steps(start: State, rows: np.ndarray, solver: AbstractRosenbrock) -> RecordedSteps:
    """From the records of `Saved(steps=True)`, shape (n, numbers), as diffrax would have them."""
    kind: Callable[..., State] = type(start)
    size = len(start)
    first = np.array([0.0, *(float(leaf) for leaf in start)])
    ends = np.vstack([first, rows[:, : 1 + size]]).T.copy()
    # One step more than there are: where there are none, diffrax looks into one all the same.
    times = np.append(ends[0], np.inf)
    infos = np.vstack([ends[1:, :-1], rows[:, 1:].T])
    infos = np.pad(infos, ((0, 0), (0, 1)), constant_values=np.inf)
    groups = [kind(*infos[k : k + size]) for k in range(0, len(infos), size)]
    # One transfer for all of them: each costs as much as several steps.
    counts = len(rows) + 1, 1  # of a weak type, as a number in diffrax's own would be
    parts = times, groups, ends[0], kind(*ends[1:]), np.float64(0.0), counts
    times, groups, t, states, zero, (count, one) = jax.device_put(parts)
    dense = diffrax.DenseInterpolation(
        ts=times,
        ts_size=count,
        infos=dict(y0=groups[0], y1=groups[1], coefficients=tuple(groups[2:])),
        interpolation_cls=solver.interpolation_cls,
        direction=one,
        t0_if_trivial=zero,
        y0_if_trivial=start,
    )
    return RecordedSteps(t, states, dense)

"""Samples of a trajectory on times fit for drawing: even ones and the solver's steps."""

from typing import Any, NamedTuple, TypeAlias, cast

import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt

from jaxbiped.measure._footsteps import HeelStrikes, heel_strikes
from jaxbiped.measure._samples import evaluate_along
from jaxbiped.plot._rigid_motion import rigid_motion
from jaxbiped.plot._skeleton import body_motion
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import State
from jaxbiped.solve._trajectory import Trajectory

AnyScene: TypeAlias = Scene | RedundantScene | RigidScene
_EVEN = 2048
"""Evenly spaced times; a fixed number, so that evaluating them compiles once."""
_IN_A_STEP = 64
"""Evenly spaced times in each footstep of a rigid walk, however long the walk."""


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


class DrawnMotion:
    """What the bodies of a walk do, on any kind of feet, by name.

    Attributes:
        first, last: times between which it is known [s]; a rigid walk is known from its first heel
            strike on.
    """

    def __init__(self, scene: AnyScene, trajectory: Trajectory[Any]) -> None:
        self._scene, self._trajectory = scene, trajectory
        self._rigid = None
        if isinstance(scene, RigidScene):
            self._rigid = rigid_motion(scene, trajectory)
            self.first, self.last = float(self._rigid.began[0]), self._rigid.end
        else:
            self.first, self.last = 0.0, end_time(trajectory)

    def at(self, t: np.ndarray) -> dict[str, np.ndarray]:
        """Places, angles and rates at times [s]."""
        if self._rigid is not None:
            return self._rigid.motion(t)
        states = state_at(self._trajectory, t)
        found: dict[str, np.ndarray] = evaluate_along(self._scene, states, body_motion)
        return found

    def sampled(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Times fit for drawing [s], and the motion at them with all scalars of its state."""
        if self._rigid is not None:
            even = np.linspace(self.first, self.last, _EVEN)
            edges = self._rigid.both_sides()
            # Of a long walk, some in each part between jumps: no turn of a rate is passed over.
            spans, parts = np.diff(edges), np.arange(1, _IN_A_STEP) / _IN_A_STEP
            wide = spans > 1e-3 * spans.max()
            inside = edges[:-1][wide, None] + spans[wide, None] * parts
            t = np.unique(np.concatenate([even, inside.ravel(), edges]))
            return t, self._rigid.motion(t)
        t, states = sample(self._trajectory)
        motion = evaluate_along(self._scene, states, body_motion)
        return t, states._asdict() | motion

    def strikes(self) -> HeelStrikes:
        """Its heel strikes."""
        if self._rigid is not None:
            return self._rigid.strikes()
        return heel_strikes(cast("Scene", self._scene), self._trajectory)

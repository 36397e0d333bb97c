"""Motions to draw: sampled on times fit for that, as few as possible where numbers are sent."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias, cast

import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import as_array, in_parts, rows_of
from jaxbiped.dynamics._energy import powers
from jaxbiped.dynamics._equivalent_states import whole_state
from jaxbiped.dynamics._impact import push_off_work
from jaxbiped.measure._footsteps import HeelStrikes, heel_strikes
from jaxbiped.measure._samples import (
    NODES,
    Samples,
    evaluate_along,
    from_start,
    states_after,
)
from jaxbiped.plot._skeleton import body_motion
from jaxbiped.scene._modes import rigid_modes, standing_legs
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import State
from jaxbiped.scene._structure import Structure
from jaxbiped.simulate._trajectory import Trajectory

AnyScene: TypeAlias = Scene | RedundantScene | RigidScene
_EVEN = 2048
"""Evenly spaced times; a fixed number, so that evaluating them compiles once."""
_IN_A_STEP = 64
"""Evenly spaced times in each footstep of a rigid walk, however long the walk."""
Channels = dict[str, np.ndarray]
"""What is shown of a motion, by name; arrays of shape (n,)."""
_ROUNDS = 6
_PARTS = 4
_PASSES = 10


class SampledMotion(NamedTuple):
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
) -> SampledMotion:
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
    return SampledMotion(t, state)


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
        return evaluate_along(self._scene, states, body_motion)

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


BEFORE = 1e-7
"""How long before and behind a jump of rates a motion is seen, in parts of its footstep."""
_AT_ONCE = 1024
"""Walks in one call: one size for all lengths."""


@dataclasses.dataclass(frozen=True)
class RigidMotion:
    """A rigid walk from its heel strikes, footstep by footstep.

    At each heel strike a rigid walk exchanges the names of its sides, so that the same leg stands
    in every state. Here bodies and feet keep the names that they have at its first state.

    Attributes:
        scene: what walks.
        began: when each footstep begins [s], shape (n,).
        starts: the states then.
        end: when the last one ends [s].
        changes: when the mode changes between heel strikes [s].
    """

    scene: RigidScene
    began: np.ndarray
    starts: Any
    end: float
    changes: np.ndarray

    def rows(self, t: np.ndarray) -> np.ndarray:
        """Which footstep each time [s] lies in."""
        return np.maximum(np.searchsorted(self.began, t, side="right") - 1, 0)

    def both_sides(self) -> np.ndarray:
        """Times at once before and behind all jumps of rates [s], and both ends."""
        jumps = np.concatenate([self.began[1:], self.changes])
        near = BEFORE * np.diff([*self.began, self.end])
        behind = np.concatenate([self.began[1:], self.changes + near[self.rows(self.changes)]])
        before = jumps - near[self.rows(jumps - 1e-12 * self.end)]
        return np.unique([self.began[0], *before, *behind, self.end])

    def along(self, function: Callable[..., Any], t: np.ndarray) -> dict[str, np.ndarray]:
        """What a function of (scene, state) has by name at times [s], sides exchanged back."""
        rows = self.rows(t)
        each = rows_of(self.starts, rows)
        states = _states_of_walks(self.scene, each, t - self.began[rows])
        found: Any = evaluate_along(self.scene, states, function)
        return _exchanged_back(self.scene.mechanism.structure, found, rows)

    def motion(self, t: np.ndarray) -> dict[str, np.ndarray]:
        """Places, angles and rates of the root point and all bodies by name at times [s]."""
        return self.along(_whole_motion, t)

    def driving_work(self, t: np.ndarray) -> np.ndarray:
        """Work of all that drives since the first of the times [J], shape (n,).

        The times increase and lie on both sides of all jumps; push-offs come at heel strikes.
        """
        pushes, strikes = np.zeros(len(t)), np.searchsorted(t, self.began[1:])
        pushes[strikes] = self.along(_push_off, t[strikes - 1])["work"]
        times = t[:-1, None] + 0.5 * np.diff(t)[:, None] * (1.0 + NODES)
        power = self.along(_driving_power, times.ravel())["power"].reshape(times.shape)
        return np.append(0.0, np.cumsum(Samples(t, None).integral(power))) + np.cumsum(pushes)

    def standing_legs(self) -> np.ndarray:
        """Number of the leg that stands in each footstep, from 0 on."""
        structure = self.scene.mechanism.structure
        able = standing_legs(structure)
        if len(able) > 1:
            modes = rigid_modes(self.scene.mechanism)
            mode = modes.decoded(np, np.asarray(self.starts.mode))
            stands = [modes.stands_on(mode, leg) for leg in able]
            return np.asarray(able)[np.argmax(stands, axis=0)]
        return np.resize(structure.namings, len(self.began))

    def strikes(self) -> HeelStrikes:
        """Its heel strikes; a start is none."""
        struck = self.began > 0.0
        return HeelStrikes(self.began[struck], 1 + self.standing_legs()[struck])


def rigid_motion(scene: RigidScene, walk: Trajectory[Any]) -> RigidMotion:
    """The motion of a rigid walk from the first heel strike on that it kept, or from its start.

    What comes after the last heel strike that the walk kept (`max_arrivals`) is left out where
    there were more. Raises `ArgumentError` for a walk without heel strikes.
    """
    check_type("trajectory.state", walk.state, scene.state_type)
    if walk.dense is not None:
        walk = from_start(scene, walk, rows_of(walk.state, 0))
    times, states, end = np.zeros(0), walk.state, float(np.asarray(walk.t)[-1])
    if walk.arrivals is not None:
        kept = np.isfinite(np.asarray(walk.arrivals.t))
        times = np.asarray(walk.arrivals.t)[kept]
        states = rows_of(walk.arrivals.state, kept)
        if times.size and int(walk.arrivals.total) > times.size:
            end = float(times[-1])
    if not times.size or (len(times) == 1 and end <= times[0]):
        raise ArgumentError(
            "trajectory kept no heel strikes, which is not allowed: walk further with "
            "save=HeelStrike(), or give `view` its start."
        )
    if end <= times[-1]:  # with a heel strike: the motion is that before it
        end = float(times[-1] - BEFORE * (times[-1] - times[-2]))
        times, states = times[:-1], jtu.tree_map(lambda leaf: leaf[:-1], states)
    history, changes = walk.mode_history, np.zeros(0)
    if history is not None:
        began = np.asarray(history.t)
        inside = (began > times[0]) & (began < end) & ~np.isin(began, times)
        changes = began[inside]
    return RigidMotion(scene, times, states, end, changes)


def _exchanged_back(
    structure: Structure, values: dict[str, np.ndarray], rows: np.ndarray
) -> dict[str, np.ndarray]:
    """What bodies and feet have, under the names that they have in the first footstep."""
    changed, odd = dict(values), rows % 2 == 1
    for j, twin in enumerate(structure.body_twins or ()):
        for word in ("theta", "omega"):
            name, other = (f"{word}_{structure.bodies[k]}" for k in (j, twin))
            if name in values:
                changed[name] = np.where(odd, values[other], values[name])
    turn = structure.turn
    if turn is not None and (name := f"theta_{structure.bodies[turn.body]}") in values:
        changed[name] = values[name] - 2.0 * np.pi / turn.order * rows
    for word in ("normal", "tangential"):
        names = [f"{word}_{k + 1}" for k in range(len(structure.feet))]
        if names[0] in values:
            changed |= {name: np.zeros(len(rows)) for name in names}
            for row in np.unique(rows):
                for k, name in zip(structure.feet_renamed(-int(row)), names, strict=True):
                    first = names[k]
                    changed[first] = np.where(rows == row, values[name], changed[first])
    return changed


def _whole_motion(scene: RigidScene, state: Any) -> dict[str, Any]:
    return body_motion(scene, whole_state(scene, state))


def _driving_power(scene: RigidScene, state: Any) -> dict[str, Any]:
    return {"power": powers(scene, state).actuation}


def _push_off(scene: RigidScene, state: Any) -> dict[str, Any]:
    return {"work": push_off_work(scene, state)}


def _states_of_walks(scene: RigidScene, starts: Any, durations: np.ndarray) -> Any:
    # No time at all is not simulated.
    shortest = 1e-12 * math.sqrt(float(scene.mechanism.height) / float(scene.ground.g))

    def walked(given: tuple[Any, np.ndarray]) -> Any:
        return states_after(scene, jtu.tree_map(as_array, given[0]), given[1])

    found = in_parts(walked, (starts, np.maximum(durations, shortest)), _AT_ONCE)
    return jtu.tree_map(as_array, found)


class Tolerances(NamedTuple):
    """How exactly channels are to be interpolated.

    Attributes:
        cubic: of each coordinate its rate's name and the error allowed, in the coordinate's unit.
        linear: of other channels the error allowed, where there are such.
        shortest: interval that is not split further [s].
    """

    cubic: Mapping[str, tuple[str, float]]
    linear: Mapping[str, float]
    shortest: float


def adaptive_knots(
    evaluate: Callable[[np.ndarray], Channels], first: np.ndarray, tolerances: Tolerances
) -> tuple[np.ndarray, Channels]:
    """Increasing times [s], shape (n,), and the channels at them.

    Intervals of the `first` times, which must see everything that happens, are quartered until
    interpolation has the channels right at the quarters; then knots are left out that their
    neighbours make up for.
    """
    t, values = first, evaluate(first)
    fresh = np.diff(t) > tolerances.shortest
    shares = np.arange(1, _PARTS) / _PARTS
    for _ in range(_ROUNDS):
        left = np.repeat(np.flatnonzero(fresh), _PARTS - 1)
        if not left.size:
            break
        at = t[left] + np.resize(shares, left.size) * (t[left + 1] - t[left])
        found = evaluate(at)
        error = _error(t, values, left, left + 1, at, found, tolerances)
        wrong = error.reshape(-1, _PARTS - 1).max(axis=1) > 1.0
        parts = np.ones(len(t) - 1, dtype=int)
        parts[fresh] = _PARTS
        split = np.zeros(len(t) - 1, dtype=bool)
        split[np.flatnonzero(fresh)[wrong]] = True
        fresh = np.repeat(split, parts)
        t = np.insert(t, left + 1, at)
        values = {name: np.insert(values[name], left + 1, found[name]) for name in values}
        fresh &= np.diff(t) > tolerances.shortest
    return _necessary_knots(t, values, tolerances)


def _necessary_knots(
    t: np.ndarray, values: Channels, tolerances: Tolerances
) -> tuple[np.ndarray, Channels]:
    for _ in range(_PASSES):
        inner = np.arange(1, len(t) - 1, 2)
        there = {name: values[name][inner] for name in values}
        error = _error(t, values, inner - 1, inner + 1, t[inner], there, tolerances)
        needless = inner[error < 0.5]
        if needless.size < 0.02 * len(t):
            break
        t = np.delete(t, needless)
        values = {name: np.delete(values[name], needless) for name in values}
    return t, values


def _error(
    t: np.ndarray,
    values: Channels,
    left: np.ndarray,
    right: np.ndarray,
    at: np.ndarray,
    there: Channels,
    tolerances: Tolerances,
) -> np.ndarray:
    """The largest error of interpolation at times between knots, in parts of what is allowed."""
    width = t[right] - t[left]
    share = (at - t[left]) / width
    worst = np.zeros(len(at))
    for name, (rate, allowed) in tolerances.cubic.items():
        start, end = values[name][left], values[name][right]
        first, last, rise = width * values[rate][left], width * values[rate][right], end - start
        square, cube = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
        drawn = start + share * (first + share * (square + share * cube))
        error = np.abs(drawn - there[name])
        worst = np.maximum(worst, error / allowed)
    for name in values.keys() & tolerances.linear.keys():
        start, end = values[name][left], values[name][right]
        error = np.abs(start + share * (end - start) - there[name])
        worst = np.maximum(worst, error / tolerances.linear[name])
    return worst

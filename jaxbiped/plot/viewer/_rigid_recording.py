"""Recordings of rigid walks: footstep by footstep, the names of the legs exchanged back."""

from typing import Any

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import Scalar, as_array, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._energy import kinetic_and_moment
from jaxbiped.dynamics._rolling import rolling
from jaxbiped.dynamics._state import RigidState, check_state, whole_state
from jaxbiped.measure._samples import evaluate_along, states_after
from jaxbiped.plot.viewer._knots import Channels
from jaxbiped.plot.viewer._recording import Footprint, Recording, recording, time_unit
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._trajectory import Trajectory

_EVEN, _MOST = 0.05, 200
"""Knots of a footstep are this far apart [√(l/g)], as far as there are not more of them."""
_BEFORE = 1e-7
"""How long before its impact a footstep is seen for the last time, in parts of it."""
_AT_ONCE = 1024
"""Walks in one call: one size for all lengths."""


def record_rigid_walk(
    scene: RigidScene, walk: Trajectory[RigidState], start: RigidState | None, name: str
) -> Recording:
    """A recording of a rigid walk, from its start, or else from its first heel strike.

    What comes after the last heel strike that the walk kept (`max_arrivals`) is left out where
    there were more. At a heel strike both legs' rates jump; before it, leg 2 stands, as at the
    start. Raises `ArgumentError` for neither heel strikes nor a start.
    """
    check_type("trajectory.state", walk.state, RigidState)
    began, starts, end = _footsteps(walk, start)
    rows, t = _knot_times(began, end, _EVEN * time_unit(scene))
    each = RigidState(*[leaf[rows] for leaf in starts])
    channels = _channels(scene, _states_of_walks(scene, each, t - began[rows]))
    odd = rows % 2 == 1
    swapped = {**channels}
    for field in ("theta", "omega", "normal", "tangential"):
        one, two = channels[f"{field}_1"], channels[f"{field}_2"]
        swapped[f"{field}_1"] = np.where(odd, two, one)
        swapped[f"{field}_2"] = np.where(odd, one, two)
    total = swapped["kinetic"] - swapped["supplied"]
    swapped["lost"] = total[0] - total
    return recording(scene, name, walk.outcome, t, swapped, _footprints(scene, began, starts))


def _footsteps(
    walk: Trajectory[RigidState], start: RigidState | None
) -> tuple[np.ndarray, RigidState, float]:
    """When each footstep begins [s], the states then, and when the last one ends."""
    times, states, end = np.zeros(0), walk.state, float(np.asarray(walk.t)[-1])
    if walk.arrivals is not None:
        kept = np.isfinite(np.asarray(walk.arrivals.t))
        times = np.asarray(walk.arrivals.t)[kept]
        states = jtu.tree_map(lambda leaf: np.asarray(leaf)[kept], walk.arrivals.state)
        if times.size and int(walk.arrivals.total) > times.size:
            end = float(times[-1])
    if start is not None:
        first = check_state(start, RigidState, "start")
        times = np.concatenate([[0.0], times])
        states = jtu.tree_map(np.append, first, states)
        states = jtu.tree_map(lambda leaf: leaf[: len(times)], states)
    if not times.size or (len(times) == 1 and end <= times[0]):
        raise ArgumentError(
            "trajectory kept no heel strikes, which is not allowed without a start: walk with "
            "max_arrivals, or give start."
        )
    if end <= times[-1]:
        times, states = times[:-1], jtu.tree_map(lambda leaf: leaf[:-1], states)
    return times, states, end


def _knot_times(began: np.ndarray, end: float, apart: float) -> tuple[np.ndarray, np.ndarray]:
    """Which footstep each knot belongs to, and its time [s]: both sides of every impact."""
    rows, times = [], []
    for k, (first, last) in enumerate(zip(began, [*began[1:], end], strict=True)):
        until = last - _BEFORE * (last - first) if k + 1 < len(began) else last
        count = min(max(int(np.ceil((last - first) / apart)), 8), _MOST)
        times.append(np.linspace(first, until, count + 1))
        rows.append(np.full(count + 1, k))
    return np.concatenate(rows), np.concatenate(times)


def _states_of_walks(scene: RigidScene, starts: RigidState, durations: np.ndarray) -> RigidState:
    found, arrays = [], jtu.tree_map(as_float, scene)
    # No time at all is not simulated.
    shortest = 1e-12 * time_unit(scene)
    for k in range(0, len(durations), _AT_ONCE):
        rows = slice(k, k + _AT_ONCE)
        missing = _AT_ONCE - len(durations[rows])
        padded = [np.pad(leaf[rows], (0, missing), mode="edge") for leaf in (*starts, durations)]
        part = RigidState(*map(as_array, padded[:-1]))
        states = _states_after(arrays, part, np.maximum(padded[-1], shortest))
        found.append([np.asarray(leaf)[: _AT_ONCE - missing] for leaf in states])
    return RigidState(*[as_array(np.concatenate(leaves)) for leaves in zip(*found, strict=True)])


_states_after = cached_jit(states_after)


def _channels(scene: RigidScene, states: RigidState) -> Channels:
    """What is shown of states, leg 2 standing; gravity's work from the first of them on."""
    along: Any = evaluate_along
    channels: Channels = along(scene, states, _quantities)
    height = channels.pop("gravitational")
    return channels | {"supplied": height[0] - height}


def _quantities(scene: RigidScene, state: RigidState) -> dict[str, Scalar]:
    whole = whole_state(scene, state)
    kinetic, moment = kinetic_and_moment(scene, whole)
    force = rolling(scene, state).force
    nothing = jnp.zeros_like(whole.hip_x)
    return {
        **whole._asdict(),
        "normal_1": nothing,
        "normal_2": force.normal,
        "tangential_1": nothing,
        "tangential_2": jnp.asarray(force.tangential),
        "kinetic": kinetic,
        "gravitational": scene.ground.g * moment,
    }


def _footprints(scene: RigidScene, began: np.ndarray, starts: RigidState) -> list[Footprint]:
    """Where each footstep's stance foot comes down."""
    place = starts.hip_x + float(scene.walker.hip_to_foot) * np.sin(starts.theta_2)
    return [
        Footprint(float(time), 2 - k % 2, float(place[k]), strike=bool(time > 0.0))
        for k, time in enumerate(began)
    ]

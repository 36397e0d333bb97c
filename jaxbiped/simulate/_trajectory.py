"""Trajectory: the result of a simulation, its states between the steps, and whose scene it is.

A result knows the scene that it was computed with by a key, a number. The key is made of all the
scene's numbers and of what the scene is made of, can be traced and batched, and tells scenes apart
of which any number differs by more than rounding.
"""

import hashlib
import json
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Float, Int, PyTree, PyTreeDef

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._ending import NamedCode, endings_named
from jaxbiped._identity import identity
from jaxbiped._summary import summary
from jaxbiped._types import Numbers, Scalar, as_array, by_numpy, in_parts, is_traced
from jaxbiped.caching._caches import PROGRAMS, OfObjects, bounded_cache
from jaxbiped.compiler import host_jit
from jaxbiped.hybrid._mode_history import ModeHistory
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import State
from jaxbiped.solve._error_estimate import ErrorEstimate

if TYPE_CHECKING:
    from typing_extensions import TypeVar

    SomeState = TypeVar("SomeState", default=State)
else:
    from typing import TypeVar

    SomeState = TypeVar("SomeState")

_ROUNDING = 1e2
"""Differences of keys that count as none, in units of the walk's precision."""


class Arrivals(NamedTuple, Generic[SomeState]):
    """Arrivals at a section, of which the first n were saved.

    Attributes:
        total: how many there were, also of those that there was no room for.
        t: their times [s], shape (n,), infinite beyond the last.
        state: states at them, leaves of shape (n,), infinite likewise.
    """

    total: Int[Array, "..."]
    t: Float[Array, "..."]
    state: SomeState


class Trajectory(eqx.Module, Generic[SomeState]):
    """A simulated motion and its outcome. Under `vmap`, every leaf gains the axes of the batch.

    Attributes:
        t: saved times [s], shape (n,).
        state: states at those times, with leaves of shape (n,), of the same type as the start: a
            `State`, or a bristle, redundant, rigid or linkage state.
        ending: code of an `Ending`; `Ending(int(code))` names it.
        accepted, rejected: numbers of the solver's steps.
        dense: the continuous solution, if all steps were saved.
        arrivals: arrivals at a section, if requested; for a rigid walker, its heel strikes, just
            after the impact.
        lowest, highest: extremes over the ends of the steps, if requested.
        integrals: integrals along the motion by name, if requested.
        correction: how a redundant start was moved onto its constraints, a `Consistent`; for a
            linkage, the violation ‖Φ‖ [m] of the start.
        violation: distance of a linkage from its constraints, ‖Φ‖ at the saved times [m], shape
            (n,).
        error: estimated errors, an `ErrorEstimate` with bars by field; None unless the accuracy was
            a number.
        missed_contacts: number of contacts of a foot that steps of fixed size passed over; None if
            `dt` was not given.
        grazes: how often the swing foot of a rigid walker reached the ground, or missed it, by less
            than the tolerance resolves; these events do not count as heel strikes. None for other
            models.
        pulls: number of steps of a rigid walker after which the ground would have to pull on the
            standing foot. A real foot would fly there; the walk goes on as if it were held. None
            for other models.
        mode_history: the modes of a rigid walker, a `ModeHistory`, if more than one can occur.
        scene_key: a number that identifies the scene; measures and figures use it to refuse another
            scene.
        engine: engine that computed it: "xla", "lanes" or "cuda".
        endings: names of the endings of a hybrid system, which `ending` may tell; None for others.
    """

    t: Float[Array, "..."]
    state: SomeState
    ending: Int[Array, "..."]
    accepted: Int[Array, "..."]
    rejected: Int[Array, "..."]
    dense: diffrax.DenseInterpolation | None = None
    arrivals: Arrivals[SomeState] | None = None
    lowest: PyTree = None
    highest: PyTree = None
    integrals: PyTree = None
    correction: PyTree = None
    violation: PyTree = None
    error: ErrorEstimate | None = None
    missed_contacts: Int[Array, "..."] | None = None
    grazes: Int[Array, "..."] | None = None
    pulls: Int[Array, "..."] | None = None
    mode_history: ModeHistory | None = None
    scene_key: Float[Array, "..."] | None = None
    engine: str = eqx.field(static=True, default="xla")
    endings: tuple[str, ...] | None = eqx.field(static=True, default=None)

    def __repr__(self) -> str:
        names = endings_named(self.endings)
        return summary(self, like=self.t, code=self.ending, names=names, engine=self.engine)

    @property
    def attempted(self) -> Int[Array, "..."]:
        """Number of steps that the solver attempted, accepted or not."""
        found: Array = by_numpy(lambda _, a, b: a + b, self.accepted, self.rejected)
        return found

    @property
    def final(self) -> SomeState:
        """The last state saved."""
        return jtu.tree_map(lambda leaf: by_numpy(lambda _, x: x[..., -1], leaf), self.state)

    @property
    def outcome(self) -> NamedCode:
        """The outcome, for one simulation, not a batch: an `Ending`, or one of a hybrid system."""
        return endings_named(self.endings).of(self.ending)

    @property
    def modes(self) -> tuple[tuple[str, ...], ...]:
        """The standing feet, and the held stops as "NAME held", of each mode.

        For one walk on rigid feet; empty if only one mode can occur.
        """
        return () if self.mode_history is None else self.mode_history.names

    @property
    def mode_durations(self) -> np.ndarray:
        """Duration of each of `modes` [s], shape (n,)."""
        if self.mode_history is None:
            return np.zeros(0)
        return self.mode_history.durations(self.t[-1])

    def at(self, t: npt.ArrayLike) -> SomeState:
        """States at times `t` [s] of any shape, with the order of accuracy of the solver's dense
        output.

        Under `jit`, `vmap` or derivatives, states outside of the trajectory are NaN instead of an
        error.

        Raises:
            ValueError: a time is outside of the trajectory, only the final state or given times
                were saved, or this is a batch.
        """
        dense = self.require_dense()
        if is_traced((dense, t)):
            flat = jnp.ravel(jnp.asarray(t, dtype=self.t.dtype))
            states = jax.vmap(dense.evaluate)(flat)
            return jtu.tree_map(lambda leaf: jnp.reshape(leaf, np.shape(t)), states)
        times = np.ravel(np.asarray(t, dtype=self.t.dtype))
        _check_inside(dense, times)
        if int(dense.ts_size) == 1:
            states = jax.vmap(dense.evaluate)(times)
        else:
            states = evaluate_dense(dense, times)
        return jax.device_put(jtu.tree_map(lambda leaf: np.reshape(leaf, np.shape(t)), states))

    def require_dense(self) -> diffrax.DenseInterpolation:
        """The continuous solution of a single trajectory.

        Raises:
            ValueError: the continuous solution was not saved, or this is a batch.
        """
        if self.dense is None:
            raise ValueError(
                "There is no solution between the saved times: only `simulate` keeps it, with "
                'save="steps".'
            )
        if jnp.ndim(self.t) != 1:
            raise ValueError("This is a batch of trajectories: look at one of them at a time.")
        return self.dense


def arrivals_among(rows: Numbers, total: Scalar, like: SomeState) -> Arrivals[SomeState]:
    """The arrivals that a program recorded: rows of a time and a state `like` this one."""

    def columns(numpy: Any, rows: Any, total: Any) -> tuple[Any, ...]:
        reached = numpy.arange(rows.shape[0]) < total
        return tuple(numpy.where(reached[:, None], rows, numpy.inf).T)

    t, *leaves = by_numpy(columns, rows, total)
    return Arrivals(total, t, jtu.tree_unflatten(jtu.tree_structure(like), leaves))


def single_time(t: Scalar, state: SomeState) -> tuple[Scalar, SomeState]:
    """A time and the state then as a trajectory has them, leaves of shape (1,)."""
    as_one = partial(by_numpy, lambda numpy, leaf: numpy.reshape(leaf, (1,)))
    return jtu.tree_map(as_one, (t, state))


def _check_inside(dense: diffrax.DenseInterpolation, times: np.ndarray) -> None:
    steps = int(dense.ts_size) - 1
    ends = np.asarray(dense.ts)
    first, last = (ends[0], ends[steps]) if steps else (dense.t0, dense.t1)
    first, last = float(first), float(last)
    outside = ~((times >= first) & (times <= last))
    if outside.any():
        raise ArgumentError(
            f"t = {float(times[outside][0])!r} is not allowed: this trajectory lasts from "
            f"{first!r} to {last!r} s."
        )


def evaluate_dense(dense: diffrax.DenseInterpolation, times: np.ndarray) -> PyTree:
    """States at times of shape (n,), as NumPy arrays; NaN before the start and after the end.

    As `dense.evaluate` gives them, for a solve of at least one step.
    """
    ends = np.asarray(dense.ts)[: int(dense.ts_size)]
    infos = jtu.tree_map(np.asarray, dense.infos)
    inside = np.where((times >= ends[0]) & (times <= ends[-1]), times, np.nan)

    def states(times: np.ndarray) -> PyTree:
        # A time at a step's end is the end of that step; NaN is behind all of them.
        step = np.clip(np.searchsorted(ends, times) - 1, 0, len(ends) - 2)
        info = jtu.tree_map(lambda leaf: leaf[step], infos)
        return _evaluate(dense.interpolation_cls, ends[step], ends[step + 1], info, times)

    return in_parts(states, inside)


@host_jit(within=True)
def _evaluate(
    kind: Callable[..., diffrax.AbstractLocalInterpolation],
    start: np.ndarray,
    end: np.ndarray,
    info: PyTree,
    t: np.ndarray,
) -> PyTree:
    def evaluate(start: Scalar, end: Scalar, info: PyTree, t: Scalar) -> PyTree:
        return kind(t0=start, t1=end, **info).evaluate(t)

    return jax.vmap(evaluate)(*jtu.tree_map(jnp.asarray, (start, end, info, t)))


def scene_key(scene: Any) -> Scalar:
    """The key of a scene, shaped as its leaves; without derivatives."""
    leaves, structure = jtu.tree_flatten(scene)
    weights = _weights(structure)
    if is_traced(leaves):
        leaves = [jax.lax.stop_gradient(leaf) for leaf in leaves]
        return _sum(jnp, jnp.stack(jnp.broadcast_arrays(*map(jnp.asarray, leaves))), weights)
    # Kept as NumPy's: under `jit` an array of JAX's would be a tracer.
    return as_array(_KEYS(scene, lambda: _sum(np, np.stack(np.broadcast_arrays(*leaves)), weights)))


_KEYS = OfObjects[np.ndarray]()


def _sum(numpy: Any, values: Any, weights: np.ndarray) -> Any:
    zeros = (values == 0.0).astype(float)
    parts = (numpy.log(numpy.abs(values) + zeros), zeros, (values < 0.0).astype(float))
    return sum(numpy.tensordot(w, part, 1) for w, part in zip(weights, parts, strict=True))


def check_scene_of(trajectory: Any, scene: Any, name: str = "trajectory") -> None:
    """Raises `ArgumentError` for a scene other than the one that a motion was simulated with."""
    check_type("scene", scene, Scene, RedundantScene, RigidScene)
    check_type(name, trajectory, Trajectory)
    kept = trajectory.scene_key
    if kept is None:
        return
    own = scene_key(scene)
    if is_traced((own, kept)):
        return
    near = _ROUNDING * np.finfo(trajectory.t.dtype).eps * (1.0 + np.abs(kept))
    if np.any(np.abs(np.asarray(own) - np.asarray(kept)) > near):
        raise ArgumentError(
            f"scene is not allowed: the {name} was simulated with another one; give that one, or "
            "simulate this one."
        )


@bounded_cache(PROGRAMS)
def _weights(structure: PyTreeDef) -> np.ndarray:
    """Random numbers of each leaf, others for every structure: its weight, and two for its sign.

    Shape (3, leaves).
    """
    numbered = jtu.tree_unflatten(structure, range(structure.num_leaves))
    told = json.dumps(identity(numbered), sort_keys=True)
    seed = int.from_bytes(hashlib.sha256(told.encode()).digest()[:8], "big")
    return np.random.default_rng(seed).uniform(1.0, 2.0, (3, structure.num_leaves))

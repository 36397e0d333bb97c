"""The adaptive solve of a scene as a program for lanes: the same steps as through diffrax."""

import contextlib
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.dynamics._bristles import state_type
from jaxbiped.dynamics._motion import vector_field
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import State, exchange_legs
from jaxbiped.lanes._end_of_solve import clipped
from jaxbiped.lanes._program import Program
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._accuracy import rms_norm
from jaxbiped.solve._ending import ending_code, ending_events
from jaxbiped.solve._fence import fences_down
from jaxbiped.solve._footstep_limit import FootstepLimit
from jaxbiped.solve._rosenbrock import AbstractRosenbrock, step_of
from jaxbiped.solve._step_control import first_step, step_control

_TERM: Any = diffrax.ODETerm(vector_field)
_BISECTIONS = 50


class Solve(NamedTuple):
    """One simulation's inputs; every leaf a 64-bit floating-point number.

    Attributes:
        scene, state: what to simulate and from where.
        duration: simulated time [s]; from `almost` on, a step that would end there ends it.
        rtol, atol: tolerances.
        footsteps: after which to end, 0 for no limit.
        patience: time [s] that counts as waiting for footsteps in vain.
        most_attempts: cap on the solver's steps.
    """

    scene: Scene
    state: State
    duration: Any
    almost: Any
    rtol: Any
    atol: Any
    footsteps: Any
    patience: Any
    most_attempts: Any


class Solved(NamedTuple):
    """One simulation's outputs: the last state and time, how it ended, and its steps.

    `lowest` and `highest` are the extremes of what was asked for, None where nothing was.
    """

    t: Any
    state: State
    ending: Any
    accepted: Any
    rejected: Any
    lowest: PyTree = None
    highest: PyTree = None


class _Now(NamedTuple):
    """What is carried from attempt to attempt; as diffrax's loop has it."""

    t: Scalar
    next_t: Scalar
    state: State
    control: Any
    accepted: Scalar
    rejected: Scalar
    events: tuple[Scalar, ...]
    counted: Scalar
    last: "_Last | None"
    extremes: tuple[PyTree, PyTree] | None


class _Last(NamedTuple):
    """The last attempt: when it began, its dense output, and whether it is of note.

    It is where it was accepted, or where there is a section, where it ended past an arrival there.
    `changed` is whether the legs' names are exchanged for the next arrival.
    """

    noted: Scalar
    changed: Scalar
    t: Scalar
    state: State
    coefficients: tuple[State, ...]


class Saved(NamedTuple):
    """What a program saves of a simulation, besides its end. All hashable.

    Attributes:
        times: whether it records the state at the times of a schedule.
        section: where it does; None: nowhere.
        extremes: a function of (scene, state) whose extremes over the steps' ends are wanted, or
            None.
    """

    times: bool = False
    section: AbstractSection | None = None
    extremes: Callable[[Scene, State], PyTree] | None = None


class AdaptiveSolve:
    """The functions of a `Program` that solves a `Solve`.

    Attributes:
        solver: its steps.
        watch: misfortunes that end it.
        counting: whether footsteps are counted.
        saved: what is saved.
        fenced: whether XLA is to compile it, and not lanes (see `fenced`).
    """

    def __init__(
        self,
        solver: AbstractRosenbrock,
        watch: tuple[str, ...],
        *,
        counting: bool,
        saved: Saved,
        fenced: bool = False,
    ) -> None:
        self.solver, self.counting, self.saved, self.fenced = solver, counting, saved, fenced
        self.dense = saved.times or saved.section is not None
        self.events = ending_events(watch)

    def program(self) -> Program:
        """The program."""
        return Program(
            self.start,
            self.attempt,
            self.finish,
            record=self.record if self.dense else None,
            scheduled=self.saved.times,
        )

    def start(self, solve: Solve) -> _Now:
        zero, none = jnp.zeros_like(solve.duration), jnp.asarray(False)
        next_t, control = self._controller(solve).init(
            _TERM,
            zero,
            solve.duration,
            solve.state,
            first_step(solve.duration),
            solve.scene,
            None,
            self._error_order(),
        )
        count = jnp.zeros((), dtype=jnp.int64)
        last = None
        if self.dense:
            nothing = jtu.tree_map(jnp.zeros_like, solve.state)
            rows = len(self.solver.tableau.dense)
            last = _Last(none, jnp.asarray(True), zero, nothing, tuple([nothing] * rows))
        events = tuple([none] * len(self.events))
        extremes = None
        if self.saved.extremes is not None:
            values = _numbers(self.saved.extremes(solve.scene, solve.state))
            extremes = (values, values)
        return _Now(zero, next_t, solve.state, control, count, count, events, none, last, extremes)

    def attempt(self, solve: Solve, now: _Now) -> tuple[_Now, Scalar]:
        with contextlib.nullcontext() if self.fenced else fences_down():
            y1, error, dense = step_of(
                self.solver.tableau, _TERM, now.t, now.next_t, now.state, solve.scene
            )
        error = jtu.tree_map(lambda e: jnp.where(jnp.isnan(e), jnp.inf, e), error)
        keep, t, next_t, _, control, result = self._controller(solve).adapt_step_size(
            now.t, now.next_t, now.state, y1, solve.scene, error, self._error_order(), now.control
        )
        t, next_t = clipped(keep, t, next_t, solve.duration, solve.almost)
        state = jtu.tree_map(lambda a, b: jnp.where(keep, a, b), y1, now.state)
        one = jnp.where(keep, 1, 0)
        events, none = [], jnp.asarray(True)
        for happens in self.events.values():
            happened = jnp.asarray(happens(t, state, solve.scene))
            events.append(happened & none)
            none = none & ~happened
        counted = jnp.asarray(result != diffrax.RESULTS.successful)
        after = _Now(
            t=t,
            next_t=next_t,
            state=state,
            control=control,
            accepted=now.accepted + one,
            rejected=now.rejected + (1 - one),
            events=tuple(events),
            counted=counted,
            last=self._last(solve.scene, now, keep, state, dense) if self.dense else None,
            extremes=self._extremes(solve.scene, now, keep, state),
        )
        attempts = (after.accepted + after.rejected).astype(solve.most_attempts.dtype)
        over = (t >= solve.duration) | (attempts >= solve.most_attempts) | ~none | counted
        return after, over

    def finish(self, solve: Solve, now: _Now) -> Solved:
        done = (now.t >= solve.duration) | now.counted
        if self.counting:
            _, _, count = now.control
            few = count.astype(solve.footsteps.dtype) < solve.footsteps
            done = done & ~(few & (solve.duration >= solve.patience))
        code = ending_code(
            dict(zip(self.events, now.events, strict=True)),
            done=done,
            out_of_steps=jnp.asarray(True),
        )
        low, high = (None, None) if now.extremes is None else now.extremes
        return Solved(now.t, now.state, code, now.accepted, now.rejected, low, high)

    def record(self, solve: Solve, now: _Now, time: Scalar) -> tuple[Scalar, list[Scalar]]:
        """The state at a time within the last step, or at its arrival at the section."""
        last = now.last
        assert last is not None
        dense = self.solver.interpolation_cls(
            t0=last.t, t1=now.t, y0=last.state, y1=now.state, coefficients=last.coefficients
        )
        section = self.saved.section
        if section is None:
            return last.noted & (time <= now.t), [time, *dense.evaluate(time)]

        def arrival() -> list[Scalar]:
            # The names that the arrival went by: they have been exchanged since.
            def value(state: State) -> Scalar:
                return section.value(solve.scene, _named(~last.changed, state))

            def halve(_: Any, ends: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
                middle = 0.5 * (ends[0] + ends[1])
                before = value(dense.evaluate(middle)) < 0.0
                return jnp.where(before, middle, ends[0]), jnp.where(before, ends[1], middle)

            time = jax.lax.fori_loop(0, _BISECTIONS, halve, (last.t, now.t))[1]
            return [time, *dense.evaluate(time)]

        nothing = [jnp.zeros_like(now.t)] * (1 + len(now.state))
        return last.noted, jax.lax.cond(last.noted, arrival, lambda: nothing)

    def _last(
        self, scene: Scene, now: _Now, keep: Scalar, state: State, dense: tuple[State, ...]
    ) -> _Last:
        assert now.last is not None
        section, changed, noted = self.saved.section, now.last.changed, keep
        if section is not None:
            before, after = (_named(changed, y) for y in (now.state, state))
            rises = (section.value(scene, before) < 0.0) & (section.value(scene, after) >= 0.0)
            # The first step of a solve never counts, so it may start on its section.
            noted = keep & (now.accepted > 0) & rises & section.counts(scene, after)
            changed = changed ^ noted
        return _Last(noted, changed, now.t, now.state, dense)

    def _extremes(
        self, scene: Scene, now: _Now, keep: Scalar, state: State
    ) -> tuple[PyTree, PyTree] | None:
        if now.extremes is None or self.saved.extremes is None:
            return None
        values = _numbers(self.saved.extremes(scene, state))

        def chosen(combine: Any, old: PyTree) -> PyTree:
            return jtu.tree_map(lambda a, b: jnp.where(keep, combine(a, b), a), old, values)

        low, high = now.extremes
        return chosen(jnp.minimum, low), chosen(jnp.maximum, high)

    def _controller(self, solve: Solve) -> Any:
        control: Any = step_control(solve.rtol, solve.atol, rms_norm)
        if not self.counting:
            return control
        limit: Any = solve.footsteps
        return FootstepLimit.around(control, limit)

    def _error_order(self) -> Any:
        return self.solver.error_order(_TERM)


def _named(changed: Scalar, state: State) -> State:
    """The state with its legs' names exchanged, where they are."""
    return jtu.tree_map(lambda a, b: jnp.where(changed, a, b), exchange_legs(state), state)


def _numbers(values: PyTree) -> PyTree:
    return jtu.tree_map(lambda x: jnp.asarray(x, dtype=jnp.float64), values)


def shapes_of(scene: Scene) -> Solve:
    """The shapes of one simulation's inputs, for a scene of these laws."""
    number: Any = jax.ShapeDtypeStruct((), jnp.float64)
    scene = jtu.tree_map(lambda _: number, scene)
    kind = state_type(scene)
    return Solve(scene, kind(*[number] * len(kind._fields)), *[number] * 7)

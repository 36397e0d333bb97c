"""Adaptive solve of a scene as a program for lanes: the same method as through diffrax.

Rounding differs, and it decides on step sizes after a few steps: the steps are not the same.
"""

import contextlib
import dataclasses
import functools
import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Numbers, Scalar, as_float, select
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import Program, without_barriers
from jaxbiped.hybrid._endings import ending_code
from jaxbiped.hybrid._scales import Units, units_of
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.solve._gathering import Gathering
from jaxbiped.solve._recorders import AbstractRecorder, LastStep, Moment, Step
from jaxbiped.solve._stepper import Stepper, Tolerance
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.controllers._event_steps import (
    FootstepLimit,
    LocatedEnding,
    MissedContacts,
)
from jaxbiped.solve.controllers._step_size import walk_control
from jaxbiped.solve.controllers._switch_locator import SwitchLocator, SwitchLocatorState
from jaxbiped.solve.controllers._wrapped_control import (
    EqualSteps,
    StepControl,
    StepsOfOneSize,
    clip_step,
    first_step,
    just_before_end,
    widened_extremes,
)


class Solve(NamedTuple):
    """One simulation's inputs; every leaf a 64-bit floating-point number.

    Attributes:
        scene, state: what to simulate and from where: a `Scene` or a `RedundantScene`, and its kind
            of state.
        duration: simulated time [s]; from `almost` on, a step that would end there ends it.
        rtol, atol: tolerances, the absolute one in `units`.
        units: of the state's leaves and of time.
        footsteps: after which to end, 0 for no limit.
        patience: time [s] that counts as waiting for footsteps in vain.
        max_attempts: cap on the solver's steps.
        recording: inputs of the recorder, if it has any.
        steps: where steps have one size, and the tolerances are those of a step's stages alone.
    """

    scene: PyTree
    state: PyTree
    duration: Numbers
    almost: Numbers
    rtol: Numbers
    atol: Numbers
    units: Units
    footsteps: Numbers
    patience: Numbers
    max_attempts: Numbers
    recording: PyTree = None
    steps: StepsOfOneSize | None = None


class Solved(NamedTuple):
    """One simulation's outputs: the last state and time, how it ended, and its steps.

    `lowest` and `highest` are the extremes of what was asked for, None where nothing was; `missed`
    counts the contacts between steps of one size, None for others.
    """

    t: Scalar
    state: PyTree
    ending: Scalar
    accepted: Scalar
    rejected: Scalar
    lowest: PyTree = None
    highest: PyTree = None
    missed: Scalar | None = None


class _Now(NamedTuple):
    """What is carried from attempt to attempt; as diffrax's loop has it."""

    t: Scalar
    next_t: Scalar
    state: PyTree
    control: PyTree
    accepted: Scalar
    rejected: Scalar
    counted: Scalar
    memory: PyTree
    extremes: tuple[PyTree, PyTree] | None
    resets: Gathering | None = None


@dataclasses.dataclass(frozen=True)
class AdaptiveSolve:
    """The functions of a `Program` that solves a `Solve`. Hashable.

    Attributes:
        system: what moves.
        stepper: its steps.
        watch: failures that end it.
        counting: whether footsteps are counted.
        recorder: what is saved; None: the end alone.
        extremes: a function of (scene, state) whose extremes over the steps' ends are wanted, or
            None.
        located: whether the last step ends at the event that ends the solve.
        fenced: whether XLA is to compile it, and not lanes (see `fenced`).
    """

    system: AbstractSystem
    stepper: Stepper
    watch: tuple[str, ...]
    counting: bool
    recorder: AbstractRecorder | None = None
    extremes: Callable[[PyTree, PyTree], PyTree] | None = None
    located: bool = False
    fenced: bool = False

    def inputs(self, scene: PyTree, state: PyTree, **limits: Any) -> Solve:
        """The inputs of a solve that only waits for its recorder, from its `limits` by name."""
        return Solve(
            scene,
            state,
            almost=just_before_end(as_float(limits["duration"])),
            atol=1e-2 * limits["rtol"],
            units=units_of(scene, state),
            patience=np.asarray(np.inf),
            **limits,
        )

    def start(self, solve: Solve) -> _Now:
        zero, none = jnp.zeros_like(solve.duration), jnp.asarray(False)
        term = self._term()
        next_t, control = self._controller(solve).init(
            term,
            zero,
            solve.duration,
            solve.state,
            self._first_step(solve),
            solve.scene,
            None,
            self.stepper.error_order(term),
        )
        count = jnp.zeros((), dtype=jnp.int64)
        memory = None if self.recorder is None else self.recorder.begin(self, solve)
        extremes = None
        if self.extremes is not None:
            values = _numbers(self.extremes(solve.scene, solve.state))
            extremes = (values, values)
        resets = Gathering.none(zero) if self.system.resets else None
        return _Now(
            zero, next_t, solve.state, control, count, count, none, memory, extremes, resets
        )

    def attempt(self, solve: Solve, now: _Now) -> tuple[_Now, Scalar]:
        term, tolerance = self._term(), Tolerance(solve.rtol, solve.atol, solve.units)
        with contextlib.nullcontext() if self.fenced else without_barriers():
            y1, error, dense, last = self.stepper.advance(
                term, now.t, now.next_t, now.state, solve.scene, tolerance
            )
            if self.system.projects(solve.scene):
                y1 = self.system.project(solve.scene, y1)
        # Asked here and not where a step ends: of the state that a step starts from, the step
        # itself needs what failures are told by.
        events = self.system.failures(self.watch).values()
        failed = [jnp.asarray(each(now.t, now.state, solve.scene)) for each in events]
        ended = _has_begun(now) & functools.reduce(operator.or_, failed)
        if solve.steps is not None:
            error = jtu.tree_map(jnp.zeros_like, y1)
        errors, structure = jtu.tree_flatten(error)
        # One of them is enough for a step to be rejected.
        errors[0] = jnp.where(ended, jnp.inf, errors[0])
        error, order = jtu.tree_unflatten(structure, errors), self.stepper.error_order(term)
        keep, t, next_t, _, control, result = self._controller(solve, last).adapt_step_size(
            now.t, now.next_t, now.state, y1, solve.scene, error, order, now.control
        )
        t, next_t = clip_step(keep, t, next_t, solve.duration, solve.almost)
        state, resets = select(keep, y1, now.state), now.resets
        ends = [state]  # and behind a reset
        if resets is not None:
            t, state, resets = self._reset(solve, keep, control, t, state, resets)
            dense, ends = (*dense, y1), [*ends, state]
        counted = jnp.asarray(result != diffrax.RESULTS.successful)
        memory = now.memory
        if self.recorder is not None:
            strikes = control[-1] > now.control[-1] if self.counting else None
            taken = Step(now.t, now.state, t, state, keep, lambda _: dense, strikes=strikes)
            if self.system.lands:
                taken = taken._replace(grazes=self._landed(control).grazes)
            memory = self.recorder.follow(self, solve, memory, taken)
        after = _Now(
            t=t,
            next_t=next_t,
            state=state,
            control=control,
            accepted=now.accepted + jnp.where(keep, 1, 0),
            rejected=now.rejected + jnp.where(keep | ended, 0, 1),
            counted=counted,
            memory=memory,
            extremes=self._extremes_after(solve.scene, now, keep, ends),
            resets=resets,
        )
        attempts = (after.accepted + after.rejected).astype(solve.max_attempts.dtype)
        over = (t >= solve.duration) | (attempts >= solve.max_attempts) | ended | counted
        if resets is not None:
            over = over | resets.chatters
        decided = None if self.recorder is None else self.recorder.decides(memory)
        return after, over if decided is None else over | decided

    def finish(self, solve: Solve, now: _Now) -> PyTree:
        """What is `Solved`, or what the recorder makes of it."""
        done = (now.t >= solve.duration) | now.counted
        timed_out, count = jnp.asarray(False), None
        control = now.control
        if self.counting:
            control, _, count = control
            few = count.astype(solve.footsteps.dtype) < solve.footsteps
            timed_out = done & few & (solve.duration >= solve.patience)
            done = done & ~timed_out
        code = ending_code(
            self._happened(solve.scene, now),
            done=done,
            out_of_steps=jnp.asarray(True),
            timed_out=timed_out,
        )
        if now.resets is not None:
            code = jnp.where(now.resets.chatters, int(Ending.CHATTERS), code)
        low, high = (None, None) if now.extremes is None else now.extremes
        missed = None if solve.steps is None else control[1]
        solved = Solved(now.t, now.state, code, now.accepted, now.rejected, low, high, missed)
        if self.recorder is None:
            return solved
        return self.recorder.finish(solve, now.memory, solved, count)

    def _landed(self, control: PyTree) -> SwitchLocatorState:
        """What the switch locator knows; for a system that lands."""
        landed: SwitchLocatorState = control[0] if self.counting else control
        return landed

    def _reset(
        self,
        solve: Solve,
        keep: Scalar,
        control: PyTree,
        t: Scalar,
        state: PyTree,
        before: Gathering,
    ) -> tuple[Scalar, PyTree, Gathering]:
        """Time and state behind a step, on the switch and reset there if it ends just past one."""
        landed = self._landed(control)
        met = keep & (landed.crossed_field > 0)

        def behind() -> tuple[Scalar, PyTree, Scalar]:
            # The little time past the switch is taken back.
            rates = self.system.vector_field(t, state, solve.scene)
            on = jtu.tree_map(lambda leaf, rate: leaf - landed.past * rate, state, rates)
            after = self.system.reset_at_switch(solve.scene, on, landed.crossed_field)
            return t - landed.past, after, self.system.repeats(solve.scene, after)

        t, state, repeats = jax.lax.cond(met, behind, lambda: (t, state, jnp.asarray(False)))
        return t, state, before.after(met, t, repeats, self.system.time_unit)

    def _happened(self, scene: PyTree, now: _Now) -> dict[Ending, Scalar]:
        """The failure that ends a solve here, the first of them."""
        happened: dict[Ending, Scalar] = {}
        none = _has_begun(now)
        for name, happens in self.system.failures(self.watch).items():
            happened[name] = none & jnp.asarray(happens(now.t, now.state, scene))
            none = none & ~happened[name]
        return happened

    def record(self, solve: Solve, now: _Now, time: Scalar) -> tuple[Scalar, list[Scalar]]:
        assert self.recorder is not None
        return self.recorder.record(self, solve, now.memory, Moment(now.t, now.state), time)

    @property
    def resets(self) -> bool:
        """Whether steps may end in a reset of the state."""
        return False

    def no_coefficients(self, solve: Solve, course: bool) -> tuple[PyTree, ...]:
        """The coefficients of a `Step` before the first one: zeros."""
        nothing = jtu.tree_map(jnp.zeros_like, solve.state)
        return (nothing,) * (self.stepper.dense_count + self.system.resets)

    def course(
        self, solve: Solve, last: LastStep, t: Scalar, state: PyTree
    ) -> diffrax.AbstractLocalInterpolation:
        """The continuous solution of a step that ended at this time in this state."""
        coefficients = last.coefficients
        if self.system.resets:  # behind which the state is another one than at the step's end
            *inner, state = coefficients
            coefficients = tuple(inner)
        ends: dict[str, Any] = dict(t0=last.t, t1=t, y0=last.state, y1=state)
        return self.stepper.interpolation_cls(**ends, coefficients=coefficients)

    def state_at(self, solve: Solve, last: LastStep, now: Moment, time: Scalar) -> PyTree:
        """The state at a time within the last step."""
        return self.course(solve, last, now.t, now.state).evaluate(time)

    def arrival_near(
        self, solve: Solve, last: LastStep, now: Moment, time: Scalar, value: Any
    ) -> tuple[Scalar, PyTree]:
        """The zero of the course itself, and the state there."""
        return time, self.state_at(solve, last, now, time)

    def _extremes_after(
        self, scene: PyTree, now: _Now, keep: Scalar, states: list[PyTree]
    ) -> tuple[PyTree, PyTree] | None:
        """The extremes, with states at the step's end where it is kept."""
        if now.extremes is None or self.extremes is None:
            return None
        wider = now.extremes
        for state in states:
            wider = widened_extremes(keep, wider, _numbers(self.extremes(scene, state)))
        return wider

    def _first_step(self, solve: Solve) -> Scalar:
        if solve.steps is None:
            return first_step(solve.duration, solve.units.time)
        return jnp.asarray(solve.steps.size)

    def _controller(self, solve: Solve, probe: PyTree = None) -> StepControl:
        control: StepControl
        if solve.steps is None:
            # The last stage knows the contact at its probe; at the new value it would cost as much.
            control = walk_control(
                solve.rtol,
                solve.atol,
                solve.units,
                self.system,
                switch_weight=self.stepper.switch_weight,
                probe=probe,
            )
        else:
            control = MissedContacts(EqualSteps(solve.steps.total, solve.duration), self.system)
        if self.system.lands:
            watch = Watch(
                self.system.vector_field, self.system.switches, time_unit=self.system.time_unit
            )
            control = SwitchLocator(control, watch)
        if self.counting:
            control = FootstepLimit(control, solve.footsteps, self.system)
        return LocatedEnding(control, self.system, self.watch, probe) if self.located else control

    def _term(self) -> "diffrax.ODETerm[PyTree]":
        return diffrax.ODETerm(self.system.vector_field)


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def adaptive_program(steps: AdaptiveSolve) -> Program:
    recorder = steps.recorder
    records = recorder is not None and recorder.records
    scheduled = recorder is not None and recorder.scheduled
    record = steps.record if records else None
    return Program(steps.start, steps.attempt, steps.finish, record=record, scheduled=scheduled)


def _has_begun(now: _Now) -> Scalar:
    """Whether anything was attempted: a solve may begin in what would end it."""
    return now.accepted + now.rejected > 0


def _numbers(values: PyTree) -> PyTree:
    return jtu.tree_map(lambda x: jnp.asarray(x, dtype=jnp.float64), values)

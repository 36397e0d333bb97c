"""Adaptive solve of a scene as a program for lanes: the same method as through diffrax.

Rounding differs, and it decides on step sizes after a few steps: the steps are not the same.
"""

import contextlib
import dataclasses
import functools
import operator
from typing import Any, ClassVar, NamedTuple

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Numbers, Scalar, as_float, select
from jaxbiped.compiler import without_barriers
from jaxbiped.hybrid._endings import ending_code
from jaxbiped.hybrid._scales import Units, units_of
from jaxbiped.solve._recorders import AbstractSolve
from jaxbiped.solve._solved import Solved
from jaxbiped.solve._step_integrals import Summed
from jaxbiped.solve._stepper import Stepper, Tolerance
from jaxbiped.solve._steps import LastStep, Moment, Step
from jaxbiped.solve._switch_resets import Gathering, reset_at_switch
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
    summed: Summed | None
    resets: Gathering | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class AdaptiveSolve(AbstractSolve):
    """The functions of a `Program` that solves a `Solve`. Hashable.

    Attributes:
        stepper: its steps.
        watch: failures that end it.
        counting: whether footsteps are counted.
        located: whether the last step ends at the event that ends the solve.
        fenced: whether XLA is to compile it, and not lanes (see `fenced`).
    """

    resets: ClassVar[bool] = False
    stepper: Stepper
    watch: tuple[str, ...]
    counting: bool
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
        observed = self.observed_start(solve)
        resets = Gathering.none(zero) if self.system.resets else None
        return _Now(zero, next_t, solve.state, control, count, count, none, *observed, resets)

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
            passed = self._landed(control), keep
            t, state, _, resets = reset_at_switch(
                self._switches, solve.scene, *passed, t, state, (), resets
            )
            dense, ends = (*dense, y1), [*ends, state]
        counted = jnp.asarray(result != diffrax.RESULTS.successful)
        memory, taken = now.memory, None
        if self.observes:
            strikes = control[-1] > now.control[-1] if self.counting else None
            taken = Step(now.t, now.state, t, state, keep, lambda _: dense, strikes=strikes)
            if self.system.lands:
                taken = taken._replace(grazes=self._landed(control).grazes)
        if self.recorder is not None and taken is not None:
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
            extremes=self.widened(solve, now, lambda: (keep, ends)),
            summed=self.summed(solve, now, taken),
            resets=resets,
        )
        attempts = (after.accepted + after.rejected).astype(solve.max_attempts.dtype)
        over = (t >= solve.duration) | (attempts >= solve.max_attempts) | ended | counted
        if resets is not None:
            over = over | resets.chatters
        decided = None if self.recorder is None else self.recorder.decides(memory)
        return after, over if decided is None else over | decided

    def solved(self, solve: Solve, now: _Now) -> tuple[Solved, Scalar | None]:
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
            reached=self.system.reached,
        )
        if now.resets is not None:
            code = jnp.where(now.resets.chatters, int(Ending.CHATTERS), code)
        low, high = (None, None) if now.extremes is None else now.extremes
        steps = (now.accepted, now.rejected)
        told = {} if now.summed is None else {"integrals": now.summed.totals}
        solved = Solved(now.t, now.state, code, None, *steps, lowest=low, highest=high, **told)
        if solve.steps is not None:
            _, missed = self._landed(now.control).inner if self.system.lands else control
            solved = solved._replace(missed_contacts=missed)
        return solved, count

    @property
    def _switches(self) -> Watch:
        """What steps end on; for a system that lands."""
        watch = Watch.of(self.system, resets=self.system.resets)
        return dataclasses.replace(watch, switches=self.system.landed_switches)

    def _landed(self, control: PyTree) -> SwitchLocatorState:
        """What the switch locator knows; for a system that lands."""
        landed: SwitchLocatorState = control[0] if self.counting else control
        return landed

    def _happened(self, scene: PyTree, now: _Now) -> dict[Ending, Scalar]:
        """The failure that ends a solve here, the first of them."""
        happened: dict[Ending, Scalar] = {}
        none = _has_begun(now)
        for name, happens in self.system.failures(self.watch).items():
            happened[name] = none & jnp.asarray(happens(now.t, now.state, scene))
            none = none & ~happened[name]
        return happened

    def moment(self, solve: Solve, now: _Now) -> Moment:
        return Moment(now.t, now.state)

    def no_coefficients(self, solve: Solve, course: bool) -> tuple[PyTree, ...]:
        nothing = jtu.tree_map(jnp.zeros_like, solve.state)
        return (nothing,) * (self.stepper.dense_count + self.system.resets)

    def course(
        self, solve: Solve, last: LastStep, t: Scalar, state: PyTree
    ) -> diffrax.AbstractLocalInterpolation:
        coefficients = last.coefficients
        if self.system.resets:  # behind which the state is another one than at the step's end
            *inner, state = coefficients
            coefficients = tuple(inner)
        ends: dict[str, Any] = dict(t0=last.t, t1=t, y0=last.state, y1=state)
        return self.stepper.interpolation_cls(**ends, coefficients=coefficients)

    def state_at(self, solve: Solve, last: LastStep, now: Moment, time: Scalar) -> PyTree:
        return self.course(solve, last, now.t, now.state).evaluate(time)

    def arrival_near(
        self, solve: Solve, last: LastStep, now: Moment, time: Scalar, value: Any
    ) -> tuple[Scalar, PyTree]:
        """The zero of the course itself, and the state there."""
        return time, self.state_at(solve, last, now, time)

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
            control = SwitchLocator(control, self._switches)
        if self.counting:
            control = FootstepLimit(control, solve.footsteps, self.system)
        return LocatedEnding(control, self.system, self.watch, probe) if self.located else control

    def _term(self) -> "diffrax.ODETerm[PyTree]":
        return diffrax.ODETerm(self.system.vector_field)


def _has_begun(now: _Now) -> Scalar:
    """Whether anything was attempted: a solve may begin in what would end it."""
    return now.accepted + now.rejected > 0

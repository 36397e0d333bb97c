"""Solve of a rigid walker as a program: its steps, and what a recorder makes of them."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import Program
from jaxbiped.dynamics._stance_motion import rolling_rates
from jaxbiped.dynamics._surfaces import straight_legs
from jaxbiped.hybrid._walker_systems import Rolling
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._recorders import AbstractRecorder, LastStep, Moment, Step
from jaxbiped.solve._rigid_steps import (
    Attempted,
    FallWatch,
    RigidProgress,
    RigidWalk,
    attempt_step,
    ending_of,
    initial_progress,
    is_pulled,
)
from jaxbiped.solve._rolling_step import DOPRI8, state_after, told_state, within_step
from jaxbiped.solve.controllers._wrapped_control import widened_extremes


class RigidSolved(NamedTuple):
    """One walk's outputs: see `RigidProgress`.

    `lowest` and `highest` are the extremes of what was asked for, None where nothing was.
    """

    t: Scalar
    state: Any
    ending: Scalar
    footsteps: Scalar
    accepted: Scalar
    rejected: Scalar
    grazes: Scalar
    pulls: Scalar
    begin: Scalar | None
    lowest: PyTree = None
    highest: PyTree = None


class _Now(NamedTuple):
    """What is carried from attempt to attempt."""

    progress: RigidProgress
    memory: PyTree
    extremes: tuple[PyTree, PyTree] | None


class RollingCourse(diffrax.AbstractLocalInterpolation):
    """Continuous solution of a step in single support, told with the root point's own place.

    Attributes:
        t0, t1: ends of what is known of it [s].
        scene: what walks.
        before, after: states at the step's ends, whose place is the standing foot's, and the
            accelerations there.
        step: its length [s], which an impact may have cut short.
    """

    t0: Scalar  # type: ignore[misc]
    t1: Scalar  # type: ignore[misc]
    scene: RigidScene
    before: tuple[Any, tuple[Scalar, ...]]
    after: tuple[Any, tuple[Scalar, ...]]
    step: Scalar

    def evaluate(self, t0: Any, t1: Any = None, left: bool = True) -> Any:
        del t1, left
        place = (t0 - self.t0) / jnp.where(self.step == 0.0, 1.0, self.step)
        return told_state(self.scene, within_step(self.step, place, self.before, self.after))


@dataclasses.dataclass(frozen=True)
class RigidSolve:
    """The functions of a `Program` that solves a `RigidWalk`. Hashable.

    Attributes:
        recorder: what is saved; None: the end alone.
        extremes: a function of (scene, state) whose extremes over the steps' ends are wanted, on
            both sides of an impact, or None.
        waits: whether the duration only bounds the wait for footsteps.
        method: its steps.
        falls: what becomes of falls.
        counts_pulls: whether steps behind which the walker is pulled are counted.
    """

    recorder: AbstractRecorder | None = None
    extremes: Callable[[PyTree, PyTree], PyTree] | None = None
    waits: bool = False
    method: ExplicitMethod = DOPRI8
    falls: FallWatch = FallWatch.LOCATED
    counts_pulls: bool = True

    @property
    def system(self) -> Rolling:
        """What moves."""
        return Rolling()

    def inputs(self, scene: Any, state: Any, **limits: Any) -> RigidWalk:
        """The inputs of a solve that only waits for its recorder, from its `limits` by name."""
        return RigidWalk(scene, state, **limits)

    def start(self, walk: RigidWalk) -> _Now:
        memory = None if self.recorder is None else self.recorder.begin(self, walk)
        extremes = None
        if self.extremes is not None:
            values = self.extremes(walk.scene, walk.state)
            extremes = (values, values)
        return _Now(initial_progress(walk), memory, extremes)

    def attempt(self, walk: RigidWalk, now: _Now) -> tuple[_Now, Scalar]:
        before = now.progress
        # A step behind a fall tells its side, unless legs that bend may change it.
        falls = self.falls
        if falls is FallWatch.TOLD and straight_legs(walk.scene.mechanism) is None:
            falls = FallWatch.LOCATED
        tried = attempt_step(walk, before, method=self.method, falls=falls)
        after, over = tried.after, tried.over
        if self.counts_pulls:
            pulled = (after.accepted > before.accepted) & is_pulled(walk, after)
            after = after._replace(pulls=after.pulls + jnp.where(pulled, 1, 0))
        memory = now.memory
        if self.recorder is not None:
            memory = self.recorder.follow(self, walk, memory, self._step(walk, before, tried))
            if (decided := self.recorder.decides(memory)) is not None:
                over = over | decided
        extremes = now.extremes
        if self.extremes is not None and extremes is not None:
            for state in (tried.end(), after.state):
                values = self.extremes(walk.scene, told_state(walk.scene, state))
                extremes = widened_extremes(_ends(tried), extremes, values)
        return _Now(after, memory, extremes), over

    def finish(self, walk: RigidWalk, now: _Now) -> PyTree:
        """What is `RigidSolved`, or what the recorder makes of it."""
        done = now.progress
        code = ending_of(walk, done, jnp.asarray(self.waits))
        counts = (done.footsteps, done.accepted, done.rejected, done.grazes, done.pulls)
        begin = getattr(walk.state, "mode", None)
        begin = begin if done.modes is None else done.modes.begin
        low, high = (None, None) if now.extremes is None else now.extremes
        state = told_state(walk.scene, done.state)
        solved = RigidSolved(done.t, state, code, *counts, begin, low, high)
        if self.recorder is None:
            return solved
        return self.recorder.finish(walk, now.memory, solved, done.footsteps)

    def record(self, walk: RigidWalk, now: _Now, time: Scalar) -> tuple[Scalar, list[Scalar]]:
        assert self.recorder is not None
        here, changes = now.progress, None
        if rigid_modes(walk.scene.mechanism).any:
            changes = jnp.asarray(False) if here.modes is None else here.modes.changed
        moment = Moment(here.t, told_state(walk.scene, here.state), here.struck, changes)
        return self.recorder.record(self, walk, now.memory, moment, time)

    @property
    def resets(self) -> bool:
        """Whether steps may end in a reset of the state."""
        return True

    def no_coefficients(self, walk: RigidWalk, course: bool) -> tuple[PyTree, ...]:
        """The coefficients of a `Step` before the first one: zeros."""
        zero = jnp.zeros_like(walk.state[0])
        accelerations = (zero,) * len(walk.scene.mechanism.structure.free)
        if not course:
            return (accelerations,)
        nothing = jtu.tree_map(jnp.zeros_like, walk.state)
        return (accelerations, zero, nothing, accelerations)

    def course(self, walk: RigidWalk, last: LastStep, t: Scalar, state: PyTree) -> RollingCourse:
        """The continuous solution of a step, up to a time [s]."""
        accelerations, length, end, then = last.coefficients
        before = last.state, accelerations
        return RollingCourse(last.t, t, walk.scene, before, (end, then), length)

    def state_at(self, walk: RigidWalk, last: LastStep, now: Moment, time: Scalar) -> Any:
        """The state at a time within the last step, by a step that ends there."""
        (accelerations, *_), length = last.coefficients, time - last.t
        return state_after(walk.scene, last.state, accelerations, length, self.method)

    def arrival_near(
        self,
        walk: RigidWalk,
        last: LastStep,
        now: Moment,
        time: Scalar,
        value: Callable[[Any], Scalar],
    ) -> tuple[Scalar, Any]:
        """One step of Newton's method from a zero of the course, whose order is lower."""

        def along(time: Scalar) -> Scalar:
            return value(self.state_at(walk, last, now, time))

        off, rate = jax.jvp(along, (time,), (jnp.ones_like(time),))
        time = jnp.clip(time - off / jnp.where(rate == 0.0, 1.0, rate), last.t, now.t)
        return time, self.state_at(walk, last, now, time)

    def _step(self, walk: RigidWalk, before: RigidProgress, tried: Attempted) -> Step:
        count = len(walk.scene.mechanism.structure.free)

        def coefficients(course: bool) -> tuple[PyTree, ...]:
            """The accelerations at its start; its length, its end and the accelerations there."""
            accelerations = tuple(tried.stages[0][count:])
            if not course:
                return (accelerations,)
            then = rolling_rates(walk.scene, tried.trial)
            return (accelerations, before.step, tried.trial, then)

        after = tried.after
        return Step(
            before.t,
            before.state,
            after.t,
            after.state,
            keep=_ends(tried),
            coefficients=coefficients,
            end=lambda: told_state(walk.scene, tried.end()),
            strikes=after.struck,
            continues=before.landing > 0,
        )


def _ends(tried: Attempted) -> Scalar:
    """Whether a step's end is known: one beyond an event is followed back to it."""
    code = tried.after.code
    fell = (code == int(Ending.FELL_FORWARD)) | (code == int(Ending.FELL_BACK))
    return tried.accepted & ((tried.after.landing == 0) | fell)


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def rigid_program(steps: RigidSolve) -> Program:
    """The program of a `RigidWalk`."""
    recorder = steps.recorder
    records = recorder is not None and recorder.records
    scheduled = recorder is not None and recorder.scheduled
    record = steps.record if records else None
    return Program(steps.start, steps.attempt, steps.finish, record=record, scheduled=scheduled)

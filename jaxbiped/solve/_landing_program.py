"""Landing solve as a program: explicit steps that land on events, and what recorders save."""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, any_of
from jaxbiped.hybrid._landing_system import AbstractLandingSystem, LandingMotion
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._explicit_step import DOPRI8, state_after, within_step
from jaxbiped.solve._landing_steps import (
    Attempted,
    EndingWatch,
    Landing,
    LandingProgress,
    attempt_step,
    ending_of,
    initial_progress,
)
from jaxbiped.solve._recorders import AbstractSolve
from jaxbiped.solve._solved import Solved
from jaxbiped.solve._step_integrals import Summed
from jaxbiped.solve._steps import LastStep, Moment, Step


class _Now(NamedTuple):
    """What is carried from attempt to attempt."""

    progress: LandingProgress
    memory: PyTree
    extremes: tuple[PyTree, PyTree] | None
    summed: Summed | None


class LandingCourse(diffrax.AbstractLocalInterpolation):
    """Continuous solution of a step, of whole states.

    Attributes:
        t0, t1: ends of what is known of it [s].
        motion: what moves.
        before, after: carried states at the step's ends, and the accelerations there.
        step: its length [s], which a reset may have cut short.
    """

    t0: Scalar  # type: ignore[misc]
    t1: Scalar  # type: ignore[misc]
    motion: LandingMotion
    before: tuple[Any, tuple[Scalar, ...]]
    after: tuple[Any, tuple[Scalar, ...]]
    step: Scalar

    def evaluate(self, t0: Any, t1: Any = None, left: bool = True) -> Any:
        del t1, left
        place = (t0 - self.t0) / jnp.where(self.step == 0.0, 1.0, self.step)
        state = within_step(self.motion, self.step, place, self.before, self.after)
        return self.motion.system.completed(self.motion.args, state)


@dataclasses.dataclass(frozen=True, kw_only=True)
class LandingSolve(AbstractSolve):
    """The functions of a `Program` that solves a `Landing`. Hashable.

    Attributes:
        waits: whether the duration only bounds the wait for footsteps.
        method: its steps.
        endings: what becomes of endings.
        counts_pulls: whether steps behind which the load is below zero are counted.
    """

    resets: ClassVar[bool] = True
    system: AbstractLandingSystem
    waits: bool = False
    method: ExplicitMethod = DOPRI8
    endings: EndingWatch = EndingWatch.LOCATED
    counts_pulls: bool = True

    def inputs(self, scene: Any, state: Any, **limits: Any) -> Landing:
        """The inputs of a solve that only waits for its recorder, from its `limits` by name."""
        return Landing(self.system, scene, state, **limits)

    def start(self, solve: Landing) -> _Now:
        observed = self.observed_start(solve)
        return _Now(initial_progress(solve), *observed)

    def attempt(self, solve: Landing, now: _Now) -> tuple[_Now, Scalar]:
        system, before, endings = self.system, now.progress, self.endings
        # A step behind an ending tells which it was, unless that may change.
        if endings is EndingWatch.INTERPOLATED and not system.ending_stays(solve.scene):
            endings = EndingWatch.LOCATED
        tried = attempt_step(solve, before, method=self.method, endings=endings)
        after, over = tried.after, tried.over
        if self.counts_pulls:
            pulled = (after.accepted > before.accepted) & self._pulls(solve, after)
            after = after._replace(pulls=after.pulls + jnp.where(pulled, 1, 0))
        memory, step = now.memory, self._step(solve, before, tried) if self.observes else None
        if self.recorder is not None and step is not None:
            memory = self.recorder.follow(self, solve, memory, step)
            if (decided := self.recorder.decides(memory)) is not None:
                over = over | decided

        def ends() -> tuple[Scalar, list[Any]]:
            states = [system.completed(solve.scene, y) for y in (tried.end(), after.state)]
            return self._end_is_known(tried), states

        return _Now(
            after, memory, self.widened(solve, now, ends), self.summed(solve, now, step)
        ), over

    def solved(self, solve: Landing, now: _Now) -> tuple[Solved, Scalar]:
        done = now.progress
        code = ending_of(solve, done, jnp.asarray(self.waits))
        counts = (done.footsteps, done.accepted, done.rejected, done.grazes, done.pulls)
        begin = getattr(solve.state, "mode", None) if done.modes is None else done.modes.begin
        low, high = (None, None) if now.extremes is None else now.extremes
        state = self.system.completed(solve.scene, done.state)
        told = {} if now.summed is None else {"integrals": now.summed.totals}
        return Solved(done.t, state, code, *counts, begin, low, high, **told), done.footsteps

    def moment(self, solve: Landing, now: _Now) -> Moment:
        here, changes = now.progress, None
        if hasattr(solve.state, "mode"):
            changes = jnp.asarray(False) if here.modes is None else here.modes.changed
        state = self.system.completed(solve.scene, here.state)
        return Moment(here.t, state, here.arrived, changes)

    def no_coefficients(self, solve: Landing, course: bool) -> tuple[PyTree, ...]:
        zero = jnp.zeros_like(solve.state[0])
        accelerations = tuple(zero for _ in self.system.coordinates(solve.scene, solve.state)[0])
        if not course:
            return (accelerations,)
        nothing = jtu.tree_map(jnp.zeros_like, solve.state)
        return (accelerations, zero, nothing, accelerations)

    def course(self, solve: Landing, last: LastStep, t: Scalar, state: PyTree) -> LandingCourse:
        accelerations, length, end, then = last.coefficients
        ends = (last.state, accelerations), (end, then)
        return LandingCourse(last.t, t, solve.motion, *ends, length)

    def state_at(self, solve: Landing, last: LastStep, now: Moment, time: Scalar) -> Any:
        """The state at a time within the last step, by a step that ends there."""
        (accelerations, *_), length = last.coefficients, time - last.t
        return state_after(solve.motion, last.state, accelerations, length, self.method)

    def arrival_near(
        self,
        solve: Landing,
        last: LastStep,
        now: Moment,
        time: Scalar,
        value: Callable[[Any], Scalar],
    ) -> tuple[Scalar, Any]:
        """One step of Newton's method from a zero of the course, whose order is lower."""

        def along(time: Scalar) -> Scalar:
            return value(self.state_at(solve, last, now, time))

        off, rate = jax.jvp(along, (time,), (jnp.ones_like(time),))
        time = jnp.clip(time - off / jnp.where(rate == 0.0, 1.0, rate), last.t, now.t)
        return time, self.state_at(solve, last, now, time)

    def _step(self, solve: Landing, before: LandingProgress, tried: Attempted) -> Step:
        system, after = self.system, tried.after

        def coefficients(course: bool) -> tuple[PyTree, ...]:
            """The accelerations at its start; its length, its end and the accelerations there."""
            stage = tried.stages[0]
            accelerations = tuple(stage[len(stage) // 2 :])
            if not course:
                return (accelerations,)
            then = system.accelerations(solve.scene, tried.trial)
            return (accelerations, before.step, tried.trial, then)

        return Step(
            before.t,
            before.state,
            after.t,
            after.state,
            keep=self._end_is_known(tried),
            coefficients=coefficients,
            end=lambda: system.completed(solve.scene, tried.end()),
            strikes=after.arrived,
            changes=None if after.modes is None else after.modes.changed,
            continues=before.landing > 0,
        )

    def _pulls(self, solve: Landing, now: LandingProgress) -> Scalar:
        """Whether the ground has to pull on what stands, where a real foot would fly."""
        load = self.system.load_under(solve.scene, now.state, now.accelerations)
        return jnp.asarray(False) if load is None else (now.landing == 0) & (load < 0.0)

    def _end_is_known(self, tried: Attempted) -> Scalar:
        """Whether a step's end is known: one beyond an event is followed back to it."""
        ended = any_of([tried.after.code == int(code) for code in self.system.endings])
        return tried.accepted & ((tried.after.landing == 0) | ended)

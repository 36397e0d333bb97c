"""Solve of a rigid walker as a program: its steps, and what a recorder makes of them."""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar
from jaxbiped.dynamics._stance_motion import rolling_rates
from jaxbiped.dynamics._surfaces import straight_legs
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.hybrid._walker_systems import Rolling
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._recorders import AbstractSolve, LastStep, Moment, Step
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
from jaxbiped.solve._solved import Solved

ROLLING = Rolling()


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


@dataclasses.dataclass(frozen=True, kw_only=True)
class RigidSolve(AbstractSolve):
    """The functions of a `Program` that solves a `RigidWalk`. Hashable.

    Attributes:
        waits: whether the duration only bounds the wait for footsteps.
        method: its steps.
        falls: what becomes of falls.
        counts_pulls: whether steps behind which the walker is pulled are counted.
    """

    resets: ClassVar[bool] = True
    system: AbstractSystem = ROLLING
    waits: bool = False
    method: ExplicitMethod = DOPRI8
    falls: FallWatch = FallWatch.LOCATED
    counts_pulls: bool = True

    def inputs(self, scene: Any, state: Any, **limits: Any) -> RigidWalk:
        """The inputs of a solve that only waits for its recorder, from its `limits` by name."""
        return RigidWalk(scene, state, **limits)

    def start(self, walk: RigidWalk) -> _Now:
        observed = self.observed_start(walk)
        return _Now(initial_progress(walk), *observed)

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

        def ends() -> tuple[Scalar, list[Any]]:
            states = [told_state(walk.scene, state) for state in (tried.end(), after.state)]
            return _ends(tried), states

        return _Now(after, memory, self.widened(walk, now, ends)), over

    def solved(self, walk: RigidWalk, now: _Now) -> tuple[Solved, Scalar]:
        done = now.progress
        code = ending_of(walk, done, jnp.asarray(self.waits))
        counts = (done.footsteps, done.accepted, done.rejected, done.grazes, done.pulls)
        begin = getattr(walk.state, "mode", None)
        begin = begin if done.modes is None else done.modes.begin
        low, high = (None, None) if now.extremes is None else now.extremes
        state = told_state(walk.scene, done.state)
        return Solved(done.t, state, code, *counts, begin, low, high), done.footsteps

    def moment(self, walk: RigidWalk, now: _Now) -> Moment:
        here, changes = now.progress, None
        if rigid_modes(walk.scene.mechanism).any:
            changes = jnp.asarray(False) if here.modes is None else here.modes.changed
        return Moment(here.t, told_state(walk.scene, here.state), here.struck, changes)

    def no_coefficients(self, walk: RigidWalk, course: bool) -> tuple[PyTree, ...]:
        zero = jnp.zeros_like(walk.state[0])
        accelerations = (zero,) * len(walk.scene.mechanism.structure.free)
        if not course:
            return (accelerations,)
        nothing = jtu.tree_map(jnp.zeros_like, walk.state)
        return (accelerations, zero, nothing, accelerations)

    def course(self, walk: RigidWalk, last: LastStep, t: Scalar, state: PyTree) -> RollingCourse:
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

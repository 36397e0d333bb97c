"""Adaptive solve of a scene as a program for lanes: the same method as through diffrax.

Rounding differs, and it decides on step sizes after a few steps: the steps are not the same.
"""

import contextlib
import dataclasses
import functools
import operator
from typing import NamedTuple

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Numbers, Scalar, select
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import Program
from jaxbiped.dynamics._constrained_motion import project
from jaxbiped.dynamics._state import field_of
from jaxbiped.solve._accuracy import Units
from jaxbiped.solve._failure_events import ending_code, ending_events
from jaxbiped.solve._fusion_barrier import without_barriers
from jaxbiped.solve._saved_outputs import LastStep, Saved
from jaxbiped.solve.controllers._event_steps import FootstepLimit, LocatedEnding
from jaxbiped.solve.controllers._step_size import walk_control
from jaxbiped.solve.controllers._wrapped_control import (
    StepControl,
    clip_step,
    first_step,
    widened_extremes,
)
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock, step_of


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


class Solved(NamedTuple):
    """One simulation's outputs: the last state and time, how it ended, and its steps.

    `lowest` and `highest` are the extremes of what was asked for, None where nothing was.
    """

    t: Scalar
    state: PyTree
    ending: Scalar
    accepted: Scalar
    rejected: Scalar
    lowest: PyTree = None
    highest: PyTree = None


class _Now(NamedTuple):
    """What is carried from attempt to attempt; as diffrax's loop has it."""

    t: Scalar
    next_t: Scalar
    state: PyTree
    control: PyTree
    accepted: Scalar
    rejected: Scalar
    counted: Scalar
    last: LastStep | None
    extremes: tuple[PyTree, PyTree] | None


@dataclasses.dataclass(frozen=True)
class AdaptiveSolve:
    """The functions of a `Program` that solves a `Solve`. Hashable.

    Attributes:
        solver: its steps.
        watch: failures that end it.
        counting: whether footsteps are counted.
        saved: what is saved.
        located: whether the last step ends at the event that ends the solve.
        fenced: whether XLA is to compile it, and not lanes (see `fenced`).
    """

    solver: AbstractRosenbrock
    watch: tuple[str, ...]
    counting: bool
    saved: Saved = dataclasses.field(default_factory=Saved)
    located: bool = False
    fenced: bool = False

    def start(self, solve: Solve) -> _Now:
        zero, none = jnp.zeros_like(solve.duration), jnp.asarray(False)
        term = _term(solve)
        next_t, control = self._controller(solve).init(
            term,
            zero,
            solve.duration,
            solve.state,
            first_step(solve.duration, solve.units.time),
            solve.scene,
            None,
            self.solver.error_order(term),
        )
        count = jnp.zeros((), dtype=jnp.int64)
        last = self.saved.first(solve, self.solver) if self.saved.within else None
        extremes = None
        if self.saved.extremes is not None:
            values = _numbers(self.saved.extremes(solve.scene, solve.state))
            extremes = (values, values)
        return _Now(zero, next_t, solve.state, control, count, count, none, last, extremes)

    def attempt(self, solve: Solve, now: _Now) -> tuple[_Now, Scalar]:
        term = _term(solve)
        with contextlib.nullcontext() if self.fenced else without_barriers():
            y1, error, dense, last = step_of(
                self.solver.tableau, term, now.t, now.next_t, now.state, solve.scene
            )
            if solve.scene.redundant and solve.scene.method.projects:
                y1 = project(solve.scene, y1)
        # Asked here and not where a step ends: of the state that a step starts from, the step
        # itself needs what failures are told by.
        events = ending_events(self.watch).values()
        failed = [jnp.asarray(each(now.t, now.state, solve.scene)) for each in events]
        ended = _has_begun(now) & functools.reduce(operator.or_, failed)
        errors, structure = jtu.tree_flatten(error)
        # One of them is enough for a step to be rejected.
        errors[0] = jnp.where(ended, jnp.inf, errors[0])
        error, order = jtu.tree_unflatten(structure, errors), self.solver.error_order(term)
        keep, t, next_t, _, control, result = self._controller(solve, last).adapt_step_size(
            now.t, now.next_t, now.state, y1, solve.scene, error, order, now.control
        )
        t, next_t = clip_step(keep, t, next_t, solve.duration, solve.almost)
        state = select(keep, y1, now.state)
        counted = jnp.asarray(result != diffrax.RESULTS.successful)
        last = now.last
        if last is not None:
            last = self.saved.following(
                solve,
                last,
                began=(now.t, now.state),
                ended=(t, state),
                keep=keep,
                moving=now.accepted > 0,
                dense=dense,
                solver=self.solver,
            )
        after = _Now(
            t=t,
            next_t=next_t,
            state=state,
            control=control,
            accepted=now.accepted + jnp.where(keep, 1, 0),
            rejected=now.rejected + jnp.where(keep | ended, 0, 1),
            counted=counted,
            last=last,
            extremes=self._extremes_after(solve.scene, now, keep, state),
        )
        attempts = (after.accepted + after.rejected).astype(solve.max_attempts.dtype)
        over = (t >= solve.duration) | (attempts >= solve.max_attempts) | ended | counted
        return after, over

    def finish(self, solve: Solve, now: _Now) -> Solved:
        done = (now.t >= solve.duration) | now.counted
        timed_out = jnp.asarray(False)
        if self.counting:
            _, _, count = now.control
            few = count.astype(solve.footsteps.dtype) < solve.footsteps
            timed_out = done & few & (solve.duration >= solve.patience)
            done = done & ~timed_out
        code = ending_code(
            self._happened(solve.scene, now),
            done=done,
            out_of_steps=jnp.asarray(True),
            timed_out=timed_out,
        )
        low, high = (None, None) if now.extremes is None else now.extremes
        return Solved(now.t, now.state, code, now.accepted, now.rejected, low, high)

    def _happened(self, scene: PyTree, now: _Now) -> dict[Ending, Scalar]:
        """The failure that ends a solve here, the first of them."""
        happened: dict[Ending, Scalar] = {}
        none = _has_begun(now)
        for name, happens in ending_events(self.watch).items():
            happened[name] = none & jnp.asarray(happens(now.t, now.state, scene))
            none = none & ~happened[name]
        return happened

    def record(self, solve: Solve, now: _Now, time: Scalar) -> tuple[Scalar, list[Scalar]]:
        assert now.last is not None
        return self.saved.record(
            solve, now.last, now=(now.t, now.state), due=time, solver=self.solver
        )

    def _extremes_after(
        self, scene: PyTree, now: _Now, keep: Scalar, state: PyTree
    ) -> tuple[PyTree, PyTree] | None:
        if now.extremes is None or self.saved.extremes is None:
            return None
        values = _numbers(self.saved.extremes(scene, state))
        return widened_extremes(keep, now.extremes, values)

    def _controller(self, solve: Solve, probe: PyTree = None) -> StepControl:
        # The last stage knows the contact at its probe; at the new value it would cost as much.
        control = walk_control(
            solve.rtol,
            solve.atol,
            solve.units,
            switch_weight=self.solver.switch_weight,
            probe=probe,
        )
        if self.counting:
            control = FootstepLimit(control, solve.footsteps)
        return LocatedEnding(control, self.watch, probe) if self.located else control


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def adaptive_program(steps: AdaptiveSolve) -> Program:
    record = steps.record if steps.saved.within else None
    return Program(
        steps.start, steps.attempt, steps.finish, record=record, scheduled=steps.saved.times
    )


def _term(solve: Solve) -> "diffrax.ODETerm[PyTree]":
    return diffrax.ODETerm(field_of(solve.scene))


def _has_begun(now: _Now) -> Scalar:
    """Whether anything was attempted: a solve may begin in what would end it."""
    return now.accepted + now.rejected > 0


def _numbers(values: PyTree) -> PyTree:
    return jtu.tree_map(lambda x: jnp.asarray(x, dtype=jnp.float64), values)

"""Labelling loop: a start is followed until its label is certain, by either engine.

Both engines run these same functions, so that labels do not depend on the engine.
"""

import abc
from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Parameter, Scalar, select
from jaxbiped.basins._labels import Label
from jaxbiped.dynamics._section import MidStance
from jaxbiped.dynamics._state import State, exchange_legs
from jaxbiped.dynamics._state_quantities import recurring_leaves
from jaxbiped.solve._adaptive_program import AdaptiveSolve, Solve
from jaxbiped.solve._failure_events import WATCHES
from jaxbiped.solve._rigid_steps import (
    RigidProgress,
    RigidWalk,
    attempt_step,
    initial_progress,
    state_with_hip,
)
from jaxbiped.solve._saved_outputs import Saved
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.sweep._convergence_test import (
    UNDECIDED,
    ArrivalHistory,
    Goals,
    after_arrival,
    empty_history,
)
from jaxbiped.sweep._walk_events import arrival_time, contact_places, grazes, slip_distances

_Number = TypeVar("_Number")


class Start(NamedTuple):
    """One start's inputs; every leaf a 64-bit floating-point number, or an array of them.

    Attributes:
        solve: what to simulate: a `Solve` or a `RigidWalk`.
        goals: the gaits that it may converge to.
        gap: see `after_arrival`; 0 where recurrences are not looked for.
        patience: longest time between two footsteps [s].
    """

    solve: PyTree
    goals: Goals
    gap: Parameter
    patience: Parameter


class Outcome(NamedTuple, Generic[_Number]):
    """What became of one start; see `Labelled`. `final` is the last state on the section.

    `grazes` counts steps in which a foot grazed the ground, if that is asked for.
    """

    label: _Number
    gait: _Number
    cycle_footsteps: _Number
    footsteps: _Number
    time: _Number
    distance: _Number
    rate: _Number
    closest: _Number
    attempted: _Number
    final: tuple[_Number, ...]
    grazes: _Number | None = None


class Progress(NamedTuple):
    """What is carried from attempt to attempt.

    Attributes:
        solve: the solver's own.
        trace: see there.
        strike: time of the last footstep [s].
        landed: where each foot came down; see `slip_distances`. None for a rigid walker.
        grazes: steps that grazed so far; None where they are not counted.
    """

    solve: PyTree
    trace: ArrivalHistory
    strike: Scalar
    landed: tuple[Scalar, Scalar] | None
    grazes: Scalar | None = None


class AbstractLabellingLoop(abc.ABC):
    """The functions of a labelling loop: `begin`, `attempt` until it is over, `finish`."""

    @abc.abstractmethod
    def begin(self, start: Start) -> Progress:
        """Before the first step."""

    @abc.abstractmethod
    def attempt(self, start: Start, now: Progress) -> tuple[Progress, Scalar]:
        """One attempted step further, and whether the label is certain (boolean)."""

    @abc.abstractmethod
    def finish(self, start: Start, now: Progress) -> Outcome[Scalar]:
        """The label and what goes with it."""


class CompliantLabelling(AbstractLabellingLoop):
    """Of the compliant walker, which arrives at mid-stance, on whichever leg.

    Attributes:
        cycles: footsteps in a cycle of each known gait.
        steps: the solver's steps and endings.
        grazes: whether steps that graze are counted.
    """

    def __init__(
        self,
        solver: AbstractRosenbrock,
        cycles: tuple[int, ...],
        *,
        fenced: bool,
        grazes: bool = False,
    ) -> None:
        """`fenced`: whether XLA is to compile it."""
        self.cycles, self.grazes = cycles, grazes
        saved = Saved(times=True)  # the last step's continuous solution
        self.steps = AdaptiveSolve(solver, WATCHES, counting=True, saved=saved, fenced=fenced)

    def begin(self, start: Start) -> Progress:
        solve: Solve = start.solve
        zero = jnp.zeros_like(solve.duration)
        trace = empty_history(zero, len(solve.state) - 1, self.cycles)
        landed = contact_places(solve.scene, solve.state)
        count = jnp.zeros((), dtype=jnp.int64) if self.grazes else None
        return Progress(self.steps.start(solve), trace, zero, landed, count)

    def attempt(self, start: Start, now: Progress) -> tuple[Progress, Scalar]:
        solve: Solve = start.solve
        after, over = self.steps.attempt(solve, now.solve)
        _, _, before_count = now.solve.control
        _, _, count = after.control
        strike = jnp.where(count > before_count, after.t, now.strike)
        trace = self._traced(start, now, after)
        assert now.landed is not None
        landed, slid = slip_distances(solve.scene, after.state, now.landed)
        late = after.t - strike > start.patience
        verdict = jnp.where(late, int(Label.TIMED_OUT), trace.verdict)
        verdict = jnp.where(slid > solve.scene.walker.l, int(Label.SLID), verdict)
        trace = trace._replace(verdict=verdict)
        count = now.grazes
        if count is not None:
            span = after.t - now.solve.t
            grazed = grazes(solve.scene, span, now.solve.state, after.state, solve.rtol)
            count = count + jnp.where(grazed, 1, 0)
        return Progress(after, trace, strike, landed, count), over | (verdict != UNDECIDED)

    def finish(self, start: Start, now: Progress) -> Outcome[Scalar]:
        solved = self.steps.finish(start.solve, now.solve)
        _, _, count = now.solve.control
        return _outcome(
            now.trace,
            code=solved.ending,
            footsteps=count,
            time=solved.t,
            distance=solved.state.hip_x - start.solve.state.hip_x,
            attempted=solved.accepted + solved.rejected,
        )._replace(grazes=now.grazes)

    def _traced(self, start: Start, now: Progress, after: PyTree) -> ArrivalHistory:
        """After the last step, within which it may have arrived at mid-stance."""
        scene, last, section = start.solve.scene, after.last, MidStance()

        def rises(change: bool) -> Scalar:
            old, new = _with_leg_names(change, last.state), _with_leg_names(change, after.state)
            crosses = (section.value(scene, old) < 0.0) & (section.value(scene, new) >= 0.0)
            return crosses & section.counts(scene, new)

        first = rises(True)
        arrives = last.noted & (first | rises(False))
        dense = last.course(self.steps.solver, after.t, after.state)

        def at(time: Scalar) -> State:
            state = dense.evaluate(time)
            pairs = zip(_with_leg_names(True, state), _with_leg_names(False, state), strict=True)
            return type(state)(*[jnp.where(first, a, b) for a, b in pairs])

        def on_section() -> ArrivalHistory:
            def value(time: Scalar) -> Scalar:
                return section.value(scene, at(time))

            time = arrival_time(value, last.t, after.t)
            return _after_arrival(start, now, at(time), self.cycles)

        return _trace_or(arrives, on_section, now.trace)


class RigidLabelling(AbstractLabellingLoop):
    """Of the rigid walker, which arrives just after its impacts.

    Attributes:
        cycles: footsteps in a cycle of each known gait.
        embedded: see `rolling_step`.
        grazes: whether heel strikes that graze are told.
    """

    def __init__(self, cycles: tuple[int, ...], *, embedded: bool, grazes: bool = False) -> None:
        self.cycles, self.embedded, self.grazes = cycles, embedded, grazes

    def begin(self, start: Start) -> Progress:
        walk: RigidWalk = start.solve
        zero = jnp.zeros_like(walk.duration)
        trace = empty_history(zero, len(walk.state) - 1, self.cycles)
        return Progress(initial_progress(walk), trace, zero, None)

    def attempt(self, start: Start, now: Progress) -> tuple[Progress, Scalar]:
        after, over = attempt_step(
            start.solve, now.solve, embedded=self.embedded, lands_on_falls=False
        )

        def on_section() -> ArrivalHistory:
            return _after_arrival(start, now, after.state, self.cycles)

        trace = _trace_or(after.struck, on_section, now.trace)
        strike = jnp.where(after.struck, after.t, now.strike)
        late = after.t - strike > start.patience
        verdict = jnp.where(late, int(Label.TIMED_OUT), trace.verdict)
        trace = trace._replace(verdict=verdict)
        return Progress(after, trace, strike, None), over | (verdict != UNDECIDED)

    def finish(self, start: Start, now: Progress) -> Outcome[Scalar]:
        walked: RigidProgress = now.solve
        return _outcome(
            now.trace,
            code=walked.code,
            footsteps=walked.footsteps,
            time=walked.t,
            distance=state_with_hip(start.solve, walked).hip_x - start.solve.state.hip_x,
            attempted=walked.accepted + walked.rejected,
        )._replace(grazes=walked.grazes if self.grazes else None)


def _outcome(
    trace: ArrivalHistory,
    *,
    code: Scalar,
    footsteps: Scalar,
    time: Scalar,
    distance: Scalar,
    attempted: Scalar,
) -> Outcome[Scalar]:
    """A failure is certain; all footsteps walked without a verdict are not."""
    kind = trace.verdict.dtype
    spent = (code == int(Label.WALKING)) | (code == int(Label.OUT_OF_STEPS))
    plain = jnp.where(code == int(Label.WALKING), int(Label.UNRESOLVED), code).astype(kind)
    label = jnp.where(spent & (trace.verdict != UNDECIDED), trace.verdict, plain)
    walks = label == int(Label.WALKING)
    converges = walks | (label == int(Label.UNRESOLVED))
    return Outcome(
        label=label,
        gait=jnp.where(walks, trace.goal, -1),
        cycle_footsteps=jnp.where(converges, trace.cycle_footsteps, 0),
        footsteps=footsteps,
        time=time,
        distance=distance,
        rate=trace.rate,
        closest=trace.closest,
        attempted=attempted,
        final=trace.recent[0],
    )


def _trace_or(
    condition: Scalar, make: Callable[[], ArrivalHistory], old: ArrivalHistory
) -> ArrivalHistory:
    """A new trace where the condition holds; made only if it does in any start of the batch."""

    def made() -> ArrivalHistory:
        return select(condition, make(), old)

    trace: ArrivalHistory = jax.lax.cond(eqxi.unvmap_any(condition), made, lambda: old)
    return trace


def _after_arrival(
    start: Start, now: Progress, state: PyTree, cycles: tuple[int, ...]
) -> ArrivalHistory:
    """After an arrival in this state, its place along the slope left out."""
    recurring = tuple(recurring_leaves(state))
    return after_arrival(now.trace, recurring, start.goals, cycles, start.gap, start.solve.rtol)


def _with_leg_names(exchanged: bool, state: PyTree) -> PyTree:
    return exchange_legs(state) if exchanged else state

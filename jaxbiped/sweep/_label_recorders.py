"""Labels of starts as recorders: each step is looked at until the label of its start is certain."""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Parameter, Scalar, any_of, select
from jaxbiped.basins._labels import Label, label_names
from jaxbiped.dynamics._contacts import contact_places, slip_distances
from jaxbiped.dynamics._state import (
    cyclic_names,
    recurring_leaves,
    recurring_names,
    recurring_periods,
)
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.solve._adaptive_program import Solve
from jaxbiped.solve._landing_steps import Landing
from jaxbiped.solve._recorders import (
    AbstractRecorder,
    AbstractSolve,
    arrival_time,
    last_step,
    no_step,
    rise_within,
)
from jaxbiped.solve._solved import Solved
from jaxbiped.solve._steps import LastStep, Step
from jaxbiped.solve.controllers._grazing import grazes
from jaxbiped.sweep._convergence_test import (
    DEPTH,
    UNDECIDED,
    ArrivalHistory,
    Goals,
    after_arrival,
    empty_history,
)

_DURATION = 1e-3
"""Share of a cycle's duration by which the next one may differ where a system repeats itself."""


class Pursuit(NamedTuple):
    """What one start may converge to; every leaf 64-bit numbers, of one start or of n.

    Attributes:
        goals: the gaits that it may converge to.
        gap: see `after_arrival`; 0 where recurrences are not looked for.
        patience: longest time between two footsteps, or two arrivals of a hybrid system [s].
    """

    goals: Goals
    gap: Parameter
    patience: Parameter


class Labelled(NamedTuple):
    """Labels of n starts, with what led to them: NumPy arrays of shape (n,).

    Attributes:
        label: code of a `Label`.
        gait: position in `Family.cycles` of the gait that it converges to; −1 for none.
        cycle_footsteps: number of footsteps of that gait's cycle. If the label is "unresolved",
            that of a cycle that the last footsteps repeated, of a gait that is not among the
            attractors.
        footsteps: number of heel strikes, or of arrivals of a hybrid system, until the label was
            certain.
        time: simulated time until then [s].
        distance: distance walked along the slope until then [m]; of a hybrid system, the advance of
            its first cyclic coordinate, NaN without one.
        rate: factor by which the distance from the gait changes per footstep, over the last cycle;
            NaN without a cycle, or if the distance is only rounding.
        closest: smallest distance from any of the gaits, in its metric; infinite without an
            arrival.
        attempted: number of steps that the solver attempted, in all solves of the start.
        final: last states on the section without cyclic coordinates, shape (n, m); infinite without
            an arrival.
        doubt, disagreed, changed: if the accuracy was a number, codes of `Doubt`, sums of codes of
            `Witness`, and whether finer tolerances changed the label; otherwise None.
        grazes: number of steps in which a foot touches the ground or misses it by less than the
            tolerance resolves, or a switch of a hybrid system is grazed so, if the accuracy was a
            number and the feet are not rigid.
        endings: names of the endings of a hybrid system, whose codes `label` may hold; None for a
            walker.
    """

    label: np.ndarray
    gait: np.ndarray
    cycle_footsteps: np.ndarray
    footsteps: np.ndarray
    time: np.ndarray
    distance: np.ndarray
    rate: np.ndarray
    closest: np.ndarray
    attempted: np.ndarray
    final: np.ndarray
    doubt: np.ndarray | None = None
    disagreed: np.ndarray | None = None
    changed: np.ndarray | None = None
    grazes: np.ndarray | None = None
    endings: tuple[str, ...] | None = None

    @property
    def names(self) -> np.ndarray:
        """The labels in words, "walking period-1" and so on, shape (n,)."""
        return label_names(self.label, self.cycle_footsteps, endings=self.endings)


class LabelMemory(NamedTuple):
    """What is carried from attempt to attempt beside the solve.

    Attributes:
        last: the last step, within which it may arrive; None where only steps end in arrivals.
        trace: see there.
        times: those of the last footsteps or arrivals, the latest first; that is 0 before any [s].
        landed: where each foot came down, see `slip_distances`; () where no slip is measured.
        arrivals: number of arrivals so far; None where footsteps are counted.
        grazes: steps that grazed so far; None where they are not counted.
    """

    last: LastStep | None
    trace: ArrivalHistory
    times: tuple[Scalar, ...]
    landed: tuple[Scalar, ...] = ()
    arrivals: Scalar | None = None
    grazes: Scalar | None = None

    def with_verdict(self, label: Label, holds: Scalar) -> "LabelMemory":
        """The same with a label as its verdict if a condition holds."""
        verdict = jnp.where(holds, int(label), self.trace.verdict)
        return self._replace(trace=self.trace._replace(verdict=verdict))


@dataclasses.dataclass(frozen=True)
class AbstractLabelRecorder(AbstractRecorder):
    """Follows a start until its label is certain.

    Attributes:
        section: where it arrives.
        cycles: arrivals in a cycle of each known gait.
        grazes: whether steps that graze are counted.
    """

    records: ClassVar[bool] = False
    section: AbstractSection
    cycles: tuple[int, ...]
    grazes: bool

    def begin(self, how: AbstractSolve, solve: Any) -> LabelMemory:
        zero = jnp.zeros_like(solve.duration)
        trace = empty_history(zero, len(recurring_names(solve.state)), self.cycles)
        return LabelMemory(None, trace, (zero,))

    def decides(self, memory: LabelMemory) -> Scalar:
        return memory.trace.verdict != UNDECIDED

    def finish(
        self, solve: Any, memory: LabelMemory, solved: Any, footsteps: Scalar | None
    ) -> Labelled:
        return _outcome(
            memory.trace,
            code=solved.ending,
            footsteps=memory.arrivals if footsteps is None else footsteps,
            time=solved.t,
            distance=_advance(solve, solved),
            attempted=solved.accepted + solved.rejected,
            grazes=memory.grazes,
        )

    def _after_arrival(
        self,
        solve: Any,
        old: ArrivalHistory,
        arrives: Scalar,
        state: Callable[[], PyTree],
        lasting: tuple[Scalar, ...] | None = None,
    ) -> ArrivalHistory:
        """The trace after an arrival, if any start of the batch has one."""
        pursuit: Pursuit = solve.recording

        def made() -> ArrivalHistory:
            here, cycles = state(), self.cycles
            recurring, periods = tuple(recurring_leaves(here)), recurring_periods(here)
            new = after_arrival(
                old, recurring, pursuit.goals, cycles, pursuit.gap, solve.rtol, periods, lasting
            )
            return select(arrives, new, old)

        return jax.lax.cond(eqxi.unvmap_any(arrives), made, lambda: old)


def _time_out(solve: Any, memory: LabelMemory, t: Scalar) -> LabelMemory:
    """The same, with that verdict where the last footstep or arrival lies too far back."""
    return memory.with_verdict(Label.TIMED_OUT, t - memory.times[0] > solve.recording.patience)


@dataclasses.dataclass(frozen=True)
class LabelRecorder(AbstractLabelRecorder):
    """Labels the compliant walker, which arrives between heel strikes, on whichever leg."""

    def begin(self, how: AbstractSolve, solve: Solve) -> LabelMemory:
        return (
            super()
            .begin(how, solve)
            ._replace(
                last=no_step(how, solve, course=True),
                landed=contact_places(solve.scene, solve.state),
                grazes=jnp.zeros((), dtype=jnp.int64) if self.grazes else None,
            )
        )

    def follow(
        self, how: AbstractSolve, solve: Solve, memory: LabelMemory, step: Step
    ) -> LabelMemory:
        assert memory.last is not None
        last = last_step(step, memory.last, course=True)
        strike = jnp.where(jnp.asarray(step.strikes), step.t1, memory.times[0])
        trace = self._traced(how, solve, memory.trace, last, step)
        landed, slid = slip_distances(solve.scene, step.y1, memory.landed)
        count = memory.grazes
        if count is not None:
            old, new = (how.system.gaps(solve.scene, y) for y in (step.y0, step.y1))
            count = count + jnp.where(grazes(old, new, step.t1 - step.t0, solve.rtol), 1, 0)
        after = LabelMemory(last, trace, (strike,), landed, grazes=count)
        timed = _time_out(solve, after, step.t1)
        return timed.with_verdict(Label.SLID, slid > solve.scene.mechanism.height)

    def _traced(
        self, how: AbstractSolve, solve: Solve, trace: ArrivalHistory, last: LastStep, step: Step
    ) -> ArrivalHistory:
        """After the last step, within which it may have arrived at the section."""
        scene, system, section = solve.scene, how.system, self.section

        came = []
        for (_, old), (_, new) in zip(
            system.images(scene, last.state), system.images(scene, step.y1), strict=True
        ):
            crosses = (section.value(scene, old) < 0.0) & (section.value(scene, new) >= 0.0)
            came.append(crosses & section.counts(scene, new))
        arrives = last.noted & any_of(came)
        dense = how.course(solve, last, step.t1, step.y1)

        def at(time: Scalar) -> PyTree:
            *others, (_, state) = system.images(scene, dense.evaluate(time))
            for here, (_, image) in zip(came, others, strict=False):
                pairs = zip(image, state, strict=True)
                state = type(state)(*[jnp.where(here, a, b) for a, b in pairs])
            return state

        def on_section() -> PyTree:
            return at(arrival_time(lambda time: section.value(scene, at(time)), last.t, step.t1))

        return self._after_arrival(solve, trace, arrives, on_section)


@dataclasses.dataclass(frozen=True)
class ArrivalLabelRecorder(AbstractLabelRecorder):
    """Labels a hybrid system, whose arrivals at the section are counted in place of footsteps."""

    def begin(self, how: AbstractSolve, solve: Solve) -> LabelMemory:
        begun, none = super().begin(how, solve), jnp.zeros((), dtype=jnp.int64)
        before = (jnp.full_like(solve.duration, jnp.nan),) * (2 * DEPTH - 1)
        return begun._replace(
            last=no_step(how, solve, course=True),
            times=(*begun.times, *before),
            arrivals=none,
            grazes=none if self.grazes else None,
        )

    def follow(
        self, how: AbstractSolve, solve: Solve, memory: LabelMemory, step: Step
    ) -> LabelMemory:
        assert memory.last is not None
        assert memory.arrivals is not None
        last = last_step(step, memory.last, course=True)
        course = how.course(solve, last, step.t1, step.y1)
        rise = rise_within(self.section, how.system, solve.scene, course)
        # The first step of a solve never counts, so it may start on its section.
        arrives = rise.happens & step.keep & (last.t > 0.0)

        def on_section() -> PyTree:
            if self.section.behind_reset:
                return step.y1

            def value(time: Scalar) -> Scalar:
                return self.section.value(solve.scene, course.evaluate(time))

            return course.evaluate(arrival_time(value, rise.since, rise.until))

        lasting = _lasting(step.t1, memory.times)
        arrivals = memory.arrivals + jnp.where(arrives, 1, 0)
        after = LabelMemory(
            last,
            self._after_arrival(solve, memory.trace, arrives, on_section, lasting),
            select(arrives, (step.t1, *memory.times[:-1]), memory.times),
            arrivals=arrivals,
            grazes=step.grazes if self.grazes else None,
        )
        walked = arrivals.astype(solve.footsteps.dtype) >= solve.footsteps
        open_ = after.trace.verdict == UNDECIDED
        return _time_out(solve, after.with_verdict(Label.UNRESOLVED, open_ & walked), step.t1)


def _lasting(t: Scalar, times: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
    """Whether cycles of 1, 2, … arrivals, the last one now, take as long as the one before.

    Resets that gather come ever faster: their states repeat each other, but there is no cycle.
    """
    lasting = []
    for length in range(1, DEPTH + 1):
        middle, first = times[length - 1], times[2 * length - 1]
        change = (t - middle) - (middle - first)
        lasting.append(jnp.abs(change) <= _DURATION * (t - middle))
    return tuple(lasting)


@dataclasses.dataclass(frozen=True)
class StrikeLabelRecorder(AbstractLabelRecorder):
    """Labels a landing system, which arrives just behind its resets."""

    def follow(
        self, how: AbstractSolve, solve: Landing, memory: LabelMemory, step: Step
    ) -> LabelMemory:
        strikes = jnp.asarray(step.strikes)
        trace = self._after_arrival(solve, memory.trace, strikes, lambda: step.y1)
        strike = jnp.where(strikes, step.t1, memory.times[0])
        return _time_out(solve, LabelMemory(None, trace, (strike,)), step.t1)

    def finish(
        self, solve: Landing, memory: LabelMemory, solved: Solved, footsteps: Scalar | None
    ) -> Labelled:
        if self.grazes:
            memory = memory._replace(grazes=solved.grazes)
        return super().finish(solve, memory, solved, footsteps)


def _advance(solve: Solve | Landing, solved: Solved) -> Scalar:
    """Change of the first cyclic coordinate; NaN without one."""
    for name in cyclic_names(solve.state):
        return getattr(solved.state, name) - getattr(solve.state, name)
    return jnp.full_like(solve.duration, jnp.nan)


def _outcome(trace: ArrivalHistory, *, code: Scalar, **walked: Any) -> Labelled:
    """A failure is certain; all footsteps walked without a verdict are not."""
    kind = trace.verdict.dtype
    spent = (code == int(Label.WALKING)) | (code == int(Label.OUT_OF_STEPS))
    plain = jnp.where(code == int(Label.WALKING), int(Label.UNRESOLVED), code).astype(kind)
    label = jnp.where(spent & (trace.verdict != UNDECIDED), trace.verdict, plain)
    walks = label == int(Label.WALKING)
    converges = walks | (label == int(Label.UNRESOLVED))
    certain: dict[str, Any] = dict(
        label=label,
        gait=jnp.where(walks, trace.goal, -1),
        cycle_footsteps=jnp.where(converges, trace.cycle_footsteps, 0),
        rate=trace.rate,
        closest=trace.closest,
        final=trace.recent[0],
    )
    return Labelled(**certain, **walked)

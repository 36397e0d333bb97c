"""Recorders: what a program saves of a solve's steps, and whether that ends it."""

import abc
import dataclasses
from collections.abc import Callable, Iterable
from typing import Any, ClassVar

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, select
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import Program
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.solve._step_integrals import StepIntegrals, Summed
from jaxbiped.solve._step_polynomials import StepCubic
from jaxbiped.solve._steps import LastStep, Moment, Rise, Step
from jaxbiped.solve.controllers._wrapped_control import widened_extremes

NO_RESET, STRIKE, CHANGE = 0.0, 1.0, 2.0
"""What resets the state behind a recorded step: nothing, a heel strike, a change of mode."""
_BISECTIONS = 50
_SECANTS = 8
"""By which `arrival_time` is located, to rounding."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class AbstractSolve(abc.ABC):
    """The functions of a `Program` that solves a motion. Hashable.

    Its inputs have a scene and a state to start from; what it carries from attempt to attempt has a
    recorder's memory and the extremes so far.

    Attributes:
        system: what moves.
        recorder: what is saved; None: the end alone.
        extremes: a function of (scene, state) whose extremes over the steps' ends are wanted, on
            both sides of a reset, or None.
        integrals: what is summed along the steps, or None.
        resets: whether recorders ask which steps end in a reset. A property of the class.
    """

    resets: ClassVar[bool]
    system: AbstractSystem
    recorder: "AbstractRecorder | None" = None
    extremes: Callable[[PyTree, PyTree], PyTree] | None = None
    integrals: StepIntegrals | None = None

    @property
    def observes(self) -> bool:
        """Whether a step is asked for more than its end."""
        return self.recorder is not None or self.integrals is not None

    @abc.abstractmethod
    def start(self, solve: Any) -> Any:
        """What is carried into the first attempt."""

    @abc.abstractmethod
    def attempt(self, solve: Any, now: Any) -> tuple[Any, Scalar]:
        """What is carried behind an attempt, and whether the solve is over."""

    @abc.abstractmethod
    def solved(self, solve: Any, now: Any) -> tuple[PyTree, Scalar | None]:
        """The outputs, and how many footsteps there were, if any are counted."""

    @abc.abstractmethod
    def moment(self, solve: Any, now: Any) -> Moment:
        """Where the solve is, as it is told."""

    @abc.abstractmethod
    def no_coefficients(self, solve: Any, course: bool) -> tuple[PyTree, ...]:
        """The coefficients of a `Step` before the first one: zeros."""

    @abc.abstractmethod
    def course(
        self, solve: Any, last: LastStep, t: Scalar, state: PyTree
    ) -> diffrax.AbstractLocalInterpolation:
        """The continuous solution of a step that ended at this time in this state."""

    @abc.abstractmethod
    def state_at(self, solve: Any, last: LastStep, now: Moment, time: Scalar) -> PyTree:
        """The state at a time within the last step, as accurate as the step's end."""

    @abc.abstractmethod
    def arrival_near(
        self,
        solve: Any,
        last: LastStep,
        now: Moment,
        time: Scalar,
        value: Callable[[PyTree], Scalar],
    ) -> tuple[Scalar, PyTree]:
        """Where a value of the state is zero, and that state, from a zero of the course."""

    def finish(self, solve: Any, now: Any) -> PyTree:
        """What is `solved`, or what the recorder makes of it."""
        solved, footsteps = self.solved(solve, now)
        if self.recorder is None:
            return solved
        return self.recorder.finish(solve, now.memory, solved, footsteps)

    def record(self, solve: Any, now: Any, time: Scalar) -> tuple[Scalar, list[Scalar]]:
        """Whether there is a row, and its numbers."""
        assert self.recorder is not None
        return self.recorder.record(self, solve, now.memory, self.moment(solve, now), time)

    def observed_start(
        self, solve: Any
    ) -> tuple[PyTree, tuple[PyTree, PyTree] | None, Summed | None]:
        """The recorder's memory, the extremes and the integrals before the first attempt."""
        memory = None if self.recorder is None else self.recorder.begin(self, solve)
        extremes = summed = None
        if self.extremes is not None:
            values = _numbers(self.extremes(solve.scene, solve.state))
            extremes = values, values
        if self.integrals is not None:
            rates = _numbers(self.integrals.rates(solve.scene, solve.state))
            nothing = jtu.tree_map(jnp.zeros_like, rates)
            summed = Summed(no_step(self, solve, course=True), nothing)
        return memory, extremes, summed

    def summed(self, solve: Any, now: Any, step: Step | None) -> Summed | None:
        """The integrals behind a step."""
        before: Summed | None = now.summed
        if self.integrals is None or before is None or step is None:
            return None
        last = last_step(step, before.last, course=True)
        course = self.course(solve, last, step.t1, step.y1)
        nothing = jtu.tree_map(jnp.zeros_like, before.totals)
        gained = self.integrals.over(solve.scene, course.evaluate, last.t, step.t1, nothing)
        # Only where steps land on strikes is the state just before one known.
        if self.resets and step.strikes is not None and step.end is not None:
            gained = jtu.tree_map(jnp.add, gained, self.integrals.at_end(solve.scene, step))
        totals = jtu.tree_map(
            lambda total, more: total + jnp.where(last.noted, more, 0.0), before.totals, gained
        )
        return Summed(last, totals)

    def widened(
        self, solve: Any, now: Any, ends: Callable[[], tuple[Scalar, Iterable[PyTree]]]
    ) -> tuple[PyTree, PyTree] | None:
        """The extremes behind a step; `ends` gives whether it is kept, and states at its end."""
        wider: tuple[PyTree, PyTree] | None = now.extremes
        if self.extremes is None or wider is None:
            return None
        keep, states = ends()
        for state in states:
            wider = widened_extremes(keep, wider, _numbers(self.extremes(solve.scene, state)))
        return wider


def _numbers(values: PyTree) -> PyTree:
    return jtu.tree_map(lambda x: jnp.asarray(x, dtype=jnp.float64), values)


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def program_of(steps: AbstractSolve) -> Program:
    """The program of a solve."""
    recorder = steps.recorder
    records = recorder is not None and recorder.records
    scheduled = recorder is not None and recorder.scheduled
    record = steps.record if records else None
    return Program(steps.start, steps.attempt, steps.finish, record=record, scheduled=scheduled)


def no_step(how: AbstractSolve, solve: PyTree, *, course: bool) -> LastStep:
    """The last step before the first attempt. `course`: whether its continuous solution is kept."""
    none, nothing = jnp.asarray(False), jtu.tree_map(jnp.zeros_like, solve.state)
    coefficients = how.no_coefficients(solve, course)
    zero = jnp.zeros_like(jtu.tree_leaves(solve.state)[0])
    return LastStep(none, zero, nothing, coefficients)


def last_step(step: Step, before: LastStep, *, course: bool) -> LastStep:
    """An attempt as the last step, of note where its end is known."""
    here = LastStep(step.keep, step.t0, step.y0, step.coefficients(course))
    if step.continues is None:
        return here
    return select(step.continues, LastStep(step.keep, *before[1:4]), here)


class AbstractRecorder(abc.ABC):
    """What a program saves of a simulation, besides its end. All hashable.

    It carries a memory from attempt to attempt, from which rows are read; it may end the solve.
    `how` is the solve's functions, which know system and steps.
    """

    records: ClassVar[bool] = True
    """Whether there are rows."""
    scheduled: ClassVar[bool] = False
    """Whether rows are made at the times of a schedule."""

    @abc.abstractmethod
    def begin(self, how: AbstractSolve, solve: PyTree) -> PyTree:
        """The memory before the first attempt."""

    @abc.abstractmethod
    def follow(self, how: AbstractSolve, solve: PyTree, memory: PyTree, step: Step) -> PyTree:
        """The memory after an attempt."""

    def decides(self, memory: PyTree) -> Scalar | None:
        """Whether the solve is over for what is known (boolean); None: never."""
        return None

    def finish(
        self, solve: PyTree, memory: PyTree, solved: PyTree, footsteps: Scalar | None
    ) -> PyTree:
        """The solve's outputs, of which it has done so many footsteps. Default: as they are."""
        return solved

    def record(
        self,
        how: AbstractSolve,
        solve: PyTree,
        memory: PyTree,
        now: Moment,
        due: Scalar,
    ) -> tuple[Scalar, list[Scalar]]:
        """Whether there is a row (boolean), and its numbers; the step ended in time and state."""
        raise NotImplementedError


@dataclasses.dataclass(frozen=True)
class StepRecorder(AbstractRecorder):
    """Records every accepted step: its end, and the coefficients of the states within it.

    Where there are resets a code follows the time, one of `NO_RESET`, `STRIKE` and `CHANGE`, and
    the state before the reset comes before that behind it.
    """

    def begin(self, how: AbstractSolve, solve: PyTree) -> LastStep:
        last = no_step(how, solve, course=False)
        return last._replace(end=last.state) if how.resets else last

    def follow(self, how: AbstractSolve, solve: PyTree, memory: LastStep, step: Step) -> LastStep:
        here = last_step(step, memory, course=False)
        return here if step.end is None else here._replace(end=step.end())

    def record(
        self,
        how: AbstractSolve,
        solve: PyTree,
        memory: LastStep,
        now: Moment,
        due: Scalar,
    ) -> tuple[Scalar, list[Scalar]]:
        numbers = jtu.tree_leaves((now.state, memory.coefficients))
        if memory.end is not None:
            numbers = [_reset_code(now), *memory.end, *numbers]
        return memory.noted, [now.t, *numbers]


@dataclasses.dataclass(frozen=True)
class TimeRecorder(AbstractRecorder):
    """Records the state at the times of a schedule."""

    scheduled: ClassVar[bool] = True

    def begin(self, how: AbstractSolve, solve: PyTree) -> LastStep:
        return no_step(how, solve, course=False)

    def follow(self, how: AbstractSolve, solve: PyTree, memory: LastStep, step: Step) -> LastStep:
        return last_step(step, memory, course=False)

    def record(
        self,
        how: AbstractSolve,
        solve: PyTree,
        memory: LastStep,
        now: Moment,
        due: Scalar,
    ) -> tuple[Scalar, list[Scalar]]:
        state = how.state_at(solve, memory, now, due)
        return memory.noted & (due <= now.t), [due, *jtu.tree_leaves(state)]


@dataclasses.dataclass(frozen=True)
class ArrivalRecorder(AbstractRecorder):
    """Records time and state at arrivals at a section.

    Attributes:
        section: where a motion arrives.
    """

    section: AbstractSection

    def begin(self, how: AbstractSolve, solve: PyTree) -> LastStep:
        last = no_step(how, solve, course=True)
        stands = jnp.asarray(how.system.standing_leg(solve.scene, solve.state))
        rise = Rise(last.noted, last.t, last.t)
        return last._replace(leg=stands, rise=rise)

    def follow(self, how: AbstractSolve, solve: PyTree, memory: LastStep, step: Step) -> LastStep:
        scene, here = solve.scene, last_step(step, memory, course=True)
        assert memory.leg is not None
        course = how.course(solve, here, step.t1, step.y1)
        # The first step of a solve never counts, so it may start on its section.
        counts = step.keep & (here.t > 0.0)
        legs = [1 + leg for leg in how.system.namings(scene)]
        alternates = self.section.alternates and len(legs) > 1
        rises = []
        for times, number in reversed(list(enumerate(legs))):
            rise = rise_within(self.section, how.system, scene, course, times)
            other = (memory.leg != number) | (not alternates)
            rises.append(rise._replace(happens=rise.happens & counts & other))
        rise, arrived = rises[-1], jnp.full_like(memory.leg, legs[0])
        for number, image in zip(legs[1:], rises[-2::-1], strict=True):
            earlier = image.happens & ~(rise.happens & (rise.until < image.until))
            rise = select(earlier, image, rise)
            arrived = select(earlier, jnp.full_like(arrived, number), arrived)
        leg = jnp.where(rise.happens, arrived, memory.leg)
        return here._replace(noted=rise.happens, leg=leg, rise=rise)

    def record(
        self,
        how: AbstractSolve,
        solve: PyTree,
        memory: LastStep,
        now: Moment,
        due: Scalar,
    ) -> tuple[Scalar, list[Scalar]]:
        nothing = [jnp.zeros_like(now.t)] * (1 + len(jtu.tree_leaves(now.state)))
        return memory.noted, jax.lax.cond(
            memory.noted, lambda: self._arrival(how, solve, memory, now), lambda: nothing
        )

    def _arrival(
        self, how: AbstractSolve, solve: PyTree, last: LastStep, now: Moment
    ) -> list[Scalar]:
        if self.section.behind_reset:
            return [now.t, *jtu.tree_leaves(now.state)]
        assert last.rise is not None
        dense = how.course(solve, last, now.t, now.state)

        def value(state: PyTree) -> Scalar:
            """Of the section, in the names of who arrives."""
            *others, (_leg, own) = how.system.images(solve.scene, state)
            for number, image in others:
                own = select(jnp.asarray(last.leg == 1 + number), image, own)
            return self.section.value(solve.scene, how.system.section_state(solve.scene, own))

        def halve(_: Scalar, ends: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
            middle = 0.5 * (ends[0] + ends[1])
            before = value(dense.evaluate(middle)) < 0.0
            return jnp.where(before, middle, ends[0]), jnp.where(before, ends[1], middle)

        time = jax.lax.fori_loop(0, _BISECTIONS, halve, last.rise[1:])[1]
        time, state = how.arrival_near(solve, last, now, time, value)
        return [time, *jtu.tree_leaves(state)]


@dataclasses.dataclass(frozen=True)
class StrikeRecorder(AbstractRecorder):
    """Records time and state just behind each footstep, or the modes of a walk that has several.

    Attributes:
        strikes: whether states are recorded, behind changes of mode too where there are any: then
            a flag, 1 behind a footstep, follows the time. Else times and modes alone are.
    """

    strikes: bool = True

    def begin(self, how: AbstractSolve, solve: PyTree) -> None:
        return None

    def follow(self, how: AbstractSolve, solve: PyTree, memory: None, step: Step) -> None:
        return None

    def record(
        self, how: AbstractSolve, solve: PyTree, memory: None, now: Moment, due: Scalar
    ) -> tuple[Scalar, list[Scalar]]:
        assert now.strikes is not None
        happens = now.strikes if now.changes is None else now.strikes | now.changes
        if not self.strikes:
            return happens, [now.t, now.state.mode]
        flag = [] if now.changes is None else [jnp.where(now.strikes, 1.0, 0.0)]
        return happens, [now.t, *flag, *now.state]


def _reset_code(now: Moment) -> Scalar:
    assert now.strikes is not None
    code = jnp.where(now.strikes, STRIKE, NO_RESET)
    return code if now.changes is None else jnp.where(now.changes, CHANGE, code)


def rise_within(
    section: AbstractSection,
    system: AbstractSystem,
    scene: PyTree,
    course: diffrax.AbstractLocalInterpolation,
    times: int = 0,
) -> Rise:
    """Where a section's value rises within a step, also if it falls again or fell before.

    The names are exchanged so many times.
    """

    def at(time: Scalar) -> PyTree:
        return system.section_state(scene, system.renamed(scene, course.evaluate(time), times))

    def value(time: Scalar) -> Scalar:
        return section.value(scene, at(time))

    t0, t1 = jnp.asarray(course.t0), jnp.asarray(course.t1)
    (old, old_rate), (new, new_rate) = (
        jax.jvp(value, (end,), (jnp.ones_like(end),)) for end in (t0, t1)
    )
    span = t1 - t0
    cubic = StepCubic(old, new, span * old_rate, span * new_rate)
    turn = t0 + span * cubic.turning_point()
    below = old < 0.0
    returns = (below == (new < 0.0)) & cubic.turns()
    no = jnp.zeros_like(returns)
    crosses = jax.lax.cond(returns, lambda: (value(turn) < 0.0) != below, lambda: no)
    until = jnp.where(crosses & below, turn, t1)
    rises = crosses | (below & (new >= 0.0))
    asked = t0 if section.behind_reset else until
    happens = jax.lax.cond(rises, lambda: jnp.asarray(section.counts(scene, at(asked))), lambda: no)
    return Rise(happens, jnp.where(crosses & ~below, turn, t0), until)


def arrival_time(value: Callable[[Scalar], Scalar], low: Scalar, high: Scalar) -> Scalar:
    """Where a function rises through zero between two times [s], by the Illinois method."""

    def secant(_: Scalar, now: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        a, b, at_a, at_b, side, _ = now
        rise = at_b - at_a
        middle = b - at_b * (b - a) / jnp.where(rise == 0.0, 1.0, rise)
        found = value(middle)
        left = found < 0.0
        # An end that stays twice counts half, so that it moves the next time.
        return (
            jnp.where(left, middle, a),
            jnp.where(left, b, middle),
            jnp.where(left, found, jnp.where(side > 0.0, 0.5 * at_a, at_a)),
            jnp.where(left, jnp.where(side < 0.0, 0.5 * at_b, at_b), found),
            jnp.where(left, -1.0, 1.0),
            middle,
        )

    start = (low, high, value(low), value(high), jnp.zeros_like(low), high)
    return jax.lax.fori_loop(0, _SECANTS, secant, start)[-1]

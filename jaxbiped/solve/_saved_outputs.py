"""Saved outputs of a solve in the lanes engine, and how they are found within a step."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, PyTree

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._equivalent_states import exchange_legs, images
from jaxbiped.dynamics._footfalls import standing_leg
from jaxbiped.dynamics._surfaces import AbstractSection
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._state_types import State
from jaxbiped.solve._step_polynomials import StepCubic
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock, RosenbrockInterpolation

if TYPE_CHECKING:
    from jaxbiped.solve._adaptive_program import Solve

_BISECTIONS = 50
_SECANTS = 8
"""By which `arrival_time` is located, to rounding."""


class Rise(NamedTuple):
    """Where a section's value rises through zero within a step.

    Attributes:
        happens: whether it does, and it is an arrival.
        since, until: times before and after [s].
    """

    happens: Scalar
    since: Scalar
    until: Scalar


class LastStep(NamedTuple):
    """The last attempt: when it began, its dense output, and whether it is of note.

    It is where it was accepted, or where there is a section, where there is an arrival within it.

    Attributes:
        leg: number of the last arrival's, from 1 on; at the start that which stands alone, 0 for
            none. None without a section, as is `rise`.
        rise: where the arrival lies.
    """

    noted: Scalar
    t: Scalar
    state: State
    coefficients: tuple[State, ...]
    leg: Scalar | None = None
    rise: Rise | None = None

    def course(
        self, solver: AbstractRosenbrock, t: Scalar, state: State
    ) -> RosenbrockInterpolation:
        """Its continuous solution, where it ended at this time in this state."""
        ends: dict[str, Any] = dict(t0=self.t, t1=t, y0=self.state, y1=state)
        return solver.interpolation_cls(**ends, coefficients=self.coefficients)


class Saved(NamedTuple):
    """What a program saves of a simulation, besides its end. All hashable.

    Attributes:
        steps: whether it records the end and the dense output of every accepted step.
        times: whether it records the state at the times of a schedule.
        section: where it does; None: nowhere.
        extremes: a function of (scene, state) whose extremes over the steps' ends are wanted, or
            None.
    """

    steps: bool = False
    times: bool = False
    section: AbstractSection | None = None
    extremes: Callable[[Scene, State], PyTree] | None = None

    @property
    def within(self) -> bool:
        """Whether anything is saved from within the steps."""
        return self.steps or self.times or self.section is not None

    def first(self, solve: "Solve", solver: AbstractRosenbrock) -> LastStep:
        """What is known before the first attempt."""
        scene, state = solve.scene, solve.state
        zero, none = jnp.zeros_like(state[0]), jnp.asarray(False)
        nothing = jtu.tree_map(jnp.zeros_like, state)
        rows = tuple([nothing] * len(solver.tableau.dense))
        if self.section is None:
            return LastStep(none, zero, nothing, rows)
        stands = jnp.asarray(standing_leg(scene.mechanism.structure, feet(scene, state)))
        return LastStep(none, zero, nothing, rows, stands, Rise(none, zero, zero))

    def following(
        self,
        solve: "Solve",
        last: LastStep,
        *,
        began: tuple[Scalar, State],
        ended: tuple[Scalar, State],
        keep: Scalar,
        moving: Scalar,
        dense: tuple[State, ...],
        solver: AbstractRosenbrock,
    ) -> LastStep:
        """What is known after an attempt.

        `keep` is whether it was accepted, and `moving` whether any was before.
        """
        scene, (t, start) = solve.scene, began
        if self.section is None:
            return LastStep(keep, t, start, dense)
        assert last.leg is not None
        course = solver.interpolation_cls(
            t0=t, t1=ended[0], y0=start, y1=ended[1], coefficients=dense
        )
        # The first step of a solve never counts, so it may start on its section.
        counts = keep & moving
        legs = [1 + leg for leg in scene.mechanism.structure.namings]
        alternates = self.section.alternates and len(legs) > 1
        rises = []
        for times, number in reversed(list(enumerate(legs))):
            rise = _rise(self.section, scene, course, times)
            other = (last.leg != number) | (not alternates)
            rises.append(rise._replace(happens=rise.happens & counts & other))
        rise, arrived = rises[-1], jnp.full_like(last.leg, legs[0])
        for number, own in zip(legs[1:], rises[-2::-1], strict=True):
            earlier = own.happens & ~(rise.happens & (rise.until < own.until))
            rise = select(earlier, own, rise)
            arrived = select(earlier, jnp.full_like(arrived, number), arrived)
        leg = jnp.where(rise.happens, arrived, last.leg)
        return LastStep(rise.happens, t, start, dense, leg, rise)

    def record(
        self,
        solve: "Solve",
        last: LastStep,
        *,
        now: tuple[Scalar, State],
        due: Scalar,
        solver: AbstractRosenbrock,
    ) -> tuple[Scalar, list[Scalar]]:
        """The step itself, the state at a time due within it, or at its arrival at the section."""
        t, state = now
        if self.steps:
            rows = [value for row in last.coefficients for value in row]
            return last.noted, [t, *state, *rows]
        dense = last.course(solver, t, state)
        if self.section is None:
            return last.noted & (due <= t), [due, *dense.evaluate(due)]
        nothing = [jnp.zeros_like(t)] * (1 + len(state))
        return last.noted, jax.lax.cond(
            last.noted, lambda: self._arrival(solve.scene, last, dense), lambda: nothing
        )

    def _arrival(
        self, scene: Scene, last: LastStep, dense: RosenbrockInterpolation
    ) -> list[Scalar]:
        section = self.section
        assert section is not None
        assert last.rise is not None

        def halve(_: Scalar, ends: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
            middle = 0.5 * (ends[0] + ends[1])
            *others, (_leg, own) = images(scene, dense.evaluate(middle))
            for number, image in others:
                own = select(jnp.asarray(last.leg == 1 + number), image, own)
            before = section.value(scene, own) < 0.0
            return jnp.where(before, middle, ends[0]), jnp.where(before, ends[1], middle)

        time = jax.lax.fori_loop(0, _BISECTIONS, halve, last.rise[1:])[1]
        return [time, *dense.evaluate(time)]


def _rise(
    section: AbstractSection, scene: Scene, course: RosenbrockInterpolation, times: int
) -> Rise:
    """Where a section's value rises within a step, also if it falls again or fell before.

    The names are exchanged so many times.
    """

    def at(time: Scalar) -> State:
        return exchange_legs(scene, course.evaluate(time), times)

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
    happens = jax.lax.cond(rises, lambda: jnp.asarray(section.counts(scene, at(until))), lambda: no)
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


def recorded_steps(
    start: PyTree, rows: np.ndarray, solver: diffrax.AbstractSolver[PyTree]
) -> tuple[Array, PyTree, diffrax.DenseInterpolation]:
    """The times [s] of a start and of n steps' ends, (n + 1,), the states there, and the rest.

    From the records of `Saved(steps=True)`, shape (n, numbers), as diffrax would have them.
    """
    kind, size = type(start), len(start)
    first = np.array([0.0, *(float(leaf) for leaf in start)])
    ends = np.vstack([first, rows[:, : 1 + size]]).T.copy()
    # One step more than there are: where there are none, diffrax looks into one all the same.
    times = np.append(ends[0], np.inf)
    infos = np.vstack([ends[1:, :-1], rows[:, 1:].T])
    infos = np.pad(infos, ((0, 0), (0, 1)), constant_values=np.inf)
    groups = [kind(*infos[k : k + size]) for k in range(0, len(infos), size)]
    # One transfer for all of them: each costs as much as several steps.
    counts = len(rows) + 1, 1  # of a weak type, as a number in diffrax's own would be
    parts = times, groups, ends[0], kind(*ends[1:]), np.float64(0.0), counts
    times, groups, t, states, zero, (count, one) = jax.device_put(parts)
    dense = diffrax.DenseInterpolation(
        ts=times,
        ts_size=count,
        infos=dict(y0=groups[0], y1=groups[1], coefficients=tuple(groups[2:])),
        interpolation_cls=solver.interpolation_cls,
        direction=one,
        t0_if_trivial=zero,
        y0_if_trivial=start,
    )
    return t, states, dense

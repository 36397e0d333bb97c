"""Variational solve for lanes: the twin of what `_solve_to_section` does through diffrax."""

import dataclasses
import functools
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, select
from jaxbiped.compiler import Program
from jaxbiped.solve._accuracy import rms_norm
from jaxbiped.solve._switch_resets import Gathering, reset_at_switch
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.controllers._step_size import step_control
from jaxbiped.solve.controllers._switch_locator import (
    SwitchLocator,
    SwitchLocatorState,
    nearest,
)
from jaxbiped.solve.controllers._wrapped_control import clip_step, first_step
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._rosenbrock_tangents import (
    Differentiated,
    column_step,
    cross,
    differentiate_step,
)
from jaxbiped.variational._saltation import (
    at_fixed_time,
    behind_arrival,
    behind_reset,
    meet,
    meeting_at,
)
from jaxbiped.variational._solve_to_section import (
    SHARE,
    onto_section,
    peak_of,
    with_peak_at_end,
)
from jaxbiped.variational._tangents import (
    Seeded,
    Tangents,
    VariationalProblem,
    VariationalSolution,
    along_columns_in_turn,
    as_columns,
    traced_once,
)


class _Now(NamedTuple):
    """What is carried from attempt to attempt.

    Columns w are derivatives at equal times since the last switch where the field is not smooth,
    which is passed τ later: those at a fixed time are w − f τ. For the field may jump at a switch
    or be infinitely steep behind it, but all motions meet it there.

    Attributes:
        columns, shifts: w and τ, of the directions of the state and of those of parameters.
        peak_columns, peak_shifts: the same where the watched quantity was largest.
    """

    t: Scalar
    next_t: Scalar
    state: PyTree
    columns: tuple[Scalar, ...]
    shifts: tuple[Scalar, ...]
    landed: SwitchLocatorState
    peak_columns: tuple[Scalar, ...]
    peak_shifts: tuple[Scalar, ...]
    attempted: Scalar
    kept: Scalar
    lost: Scalar
    resets: Gathering | None = None


class AdaptiveColumns:
    """The functions of a `Program` that solves a `VariationalProblem`.

    Attributes:
        solver: its steps.
        watch: what its steps end on, and what ends it.
        active: positions of the p parameters among the leaves of the arguments.
        save_nodes: whether the accepted steps are recorded.
    """

    def __init__(
        self,
        solver: AbstractRosenbrock,
        watch: Watch,
        active: tuple[int, ...],
        *,
        save_nodes: bool,
    ) -> None:
        self.solver, self.active = solver, active
        # Compiled by themselves, these are traced once, not at each of their many uses.
        whole = ((name, getattr(watch, name)) for name in ("section", "ending", "peak", "reset"))
        once: dict[str, Any] = {
            name: jax.jit(function) for name, function in whole if function is not None
        }
        self.watch = dataclasses.replace(watch, field=traced_once(watch.field), **once)
        self.save_nodes = save_nodes
        self.term: diffrax.ODETerm[PyTree] = diffrax.ODETerm(watch.field)

    def program(self) -> Program:
        record = self.record if self.save_nodes else None
        return Program(self.start, self.attempt, self.finish, record=record)

    def start(self, given: VariationalProblem) -> _Now:
        zero, none = jnp.zeros_like(given.max_time), jnp.asarray(False)
        next_t, landed = self._controller(given, zero).init(
            self.term,
            zero,
            given.max_time,
            given.state,
            first_step(given.max_time, given.units.time),
            given.args,
            None,
            self.solver.error_order(self.term),
        )
        columns = (given.by_state, given.by_parameter)
        count = jnp.zeros((), dtype=jnp.int64)
        landed = jtu.tree_map(jnp.asarray, landed)
        shifts = tuple(jnp.zeros(part.shape[0]) for part in columns)
        resets = None if self.watch.repeats is None else Gathering.none(zero)
        peaks = columns, shifts
        return _Now(
            zero, next_t, given.state, columns, shifts, landed, *peaks, count, none, none, resets
        )

    def attempt(self, given: VariationalProblem, now: _Now) -> tuple[_Now, Scalar]:
        times = (now.t, now.next_t)
        step = differentiate_step(
            self.solver.tableau,
            self.watch.field,
            *times,
            now.state,
            self._seeded(given),
            carries_parameters=given.carries_parameters > 0.0,
        )
        new_columns, worst = self._columns(given, now, step)
        if self.watch.project is not None:
            step, new_columns = self._projected(given, step, new_columns)
        error = jtu.tree_map(lambda e: jnp.where(jnp.isnan(e), jnp.inf, e), step.error)
        keep, t, next_t, _, landed, result = self._controller(given, worst).adapt_step_size(
            now.t,
            now.next_t,
            now.state,
            step.end,
            given.args,
            error,
            self.solver.error_order(self.term),
            now.landed,
        )
        limit = given.max_time
        t, next_t = clip_step(keep, t, next_t, limit, given.almost)
        state = select(keep, step.end, now.state)
        columns, peaks, peak_shifts = now.columns, now.peak_columns, now.peak_shifts
        resets = now.resets
        new_columns, shifts = self._met(given, now, landed, new_columns, step)
        if self.watch.reset is not None:
            reset = functools.partial(behind_reset, self.watch, self._seeded(given), given.sizes)
            end = t, state, new_columns, resets
            t, state, new_columns, resets = reset_at_switch(
                self.watch, given.args, landed, keep, *end, reset
            )
        if self.watch.peak is None:
            pairs = zip(new_columns, columns, strict=True)
            columns = tuple(jax.lax.map(lambda each: jnp.where(keep, *each), p) for p in pairs)
            peaks, peak_shifts = columns, shifts
        else:
            highest = keep & (landed.peak > now.landed.peak)
            both = [
                jax.lax.map(lambda each: _row(keep, highest, *each), (new, old, peak))
                for new, old, peak in zip(new_columns, columns, peaks, strict=True)
            ]
            columns, peaks = (tuple(part) for part in zip(*both, strict=True))
            peak_shifts = select(highest, shifts, peak_shifts)
        attempted = now.attempted + 1
        lost = jnp.asarray(result == diffrax.RESULTS.dt_min_reached)
        over = (t >= limit) | jnp.asarray(result != diffrax.RESULTS.successful)
        over = over | (attempted.astype(limit.dtype) >= given.max_attempts)
        steps = (attempted, keep, lost)
        after = _Now(t, next_t, state, columns, shifts, landed, peaks, peak_shifts, *steps, resets)
        return after, over if resets is None else over | resets.chatters

    def finish(self, given: VariationalProblem, now: _Now) -> VariationalSolution:
        ended = jnp.where(now.t >= given.max_time, int(Ending.TIMED_OUT), int(Ending.OUT_OF_STEPS))
        ended = jnp.where(now.lost, int(Ending.SOLVER_FAILED), ended)
        if now.resets is not None:
            ended = jnp.where(now.resets.chatters, int(Ending.CHATTERS), ended)
        ended = jnp.where(now.landed.code != 0, now.landed.code, ended)
        zero, field, carries = jnp.zeros(()), self.watch.field, given.carries_parameters > 0.0
        rates, unknown = field(zero, now.state, given.args), jnp.where(carries, 0.0, jnp.nan)
        by_state, by_parameter = at_fixed_time(rates, now.columns, now.shifts)
        by_parameter = jax.lax.map(lambda column: column + unknown, by_parameter)
        seeded, columns = self._seeded(given), jnp.concatenate([by_state, by_parameter]).T
        y, t, peak = Tangents(now.state, columns), now.t, jnp.zeros(())
        time_columns = peak_columns = jnp.zeros(columns.shape[1])
        if self.watch.section is not None:
            y, t, time_columns = onto_section(self.watch, y, t, seeded, along_columns_in_turn)
        reached, on_section = self.watch.node(given.args, y.state), y
        y = behind_arrival(self.watch, y, seeded)
        if self.watch.peak is not None:
            at_peak = now.landed.at_peak
            rates = field(zero, at_peak, given.args)
            peaks = at_fixed_time(rates, now.peak_columns, now.peak_shifts)
            highest = Tangents(at_peak, jnp.concatenate(peaks).T)
            peak, peak_columns = peak_of(self.watch, highest, seeded, along_columns_in_turn)
            peak_columns = jnp.where(now.landed.jumps_at_peak, jnp.nan, peak_columns)
            peak, peak_columns = with_peak_at_end(
                self.watch, (peak, peak_columns), on_section, seeded, along_columns_in_turn
            )
        return VariationalSolution(
            t=t,
            reached=reached,
            state=y.state,
            columns=y.columns.T,
            time_columns=time_columns,
            code=jnp.where(now.landed.arrived, 0, ended),
            attempted=now.attempted,
            accepted=now.landed.accepted,
            jumps=now.landed.jumps,
            grazes=now.landed.grazes,
            peak=peak,
            peak_columns=peak_columns,
        )

    def _projected(
        self, given: VariationalProblem, step: Differentiated, columns: list[Scalar]
    ) -> tuple[Differentiated, list[Scalar]]:
        """A step and its columns on the constraints."""
        project, seeds = self.watch.project, jnp.eye(len(given.sizes)) * given.sizes
        assert project is not None

        def moved(rows: Scalar, seeds: Scalar) -> tuple[PyTree, Scalar]:
            seeded = Seeded(given.args, seeds, jnp.zeros(len(rows)), self.active)
            end, found = along_columns_in_turn(
                lambda s, a: project(a, s), Tangents(step.end, rows.T), seeded
            )
            return end, as_columns(found).T

        by_state, by_parameter = columns
        end = project(given.args, step.end)
        if by_state.shape[0]:
            _, by_state = moved(by_state, jnp.zeros((len(seeds), len(by_state))))
        if by_parameter.shape[0]:
            by_parameter = jax.lax.cond(
                given.carries_parameters > 0.0,
                lambda: moved(columns[1], seeds)[1],
                lambda: columns[1],
            )
        return step._replace(end=end), [by_state, by_parameter]

    def _met(
        self,
        given: VariationalProblem,
        now: _Now,
        landed: SwitchLocatorState,
        stepped: list[Scalar],
        step: Differentiated,
    ) -> tuple[list[Scalar], tuple[Scalar, ...]]:
        """Columns and shifts after a step, which may have met a switch."""
        which = landed.crossed_field
        if not self.watch.switches(given.args, now.state):
            return stepped, now.shifts

        def met() -> tuple[list[Scalar], tuple[Scalar, ...]]:
            meeting = meeting_at(self.watch, now.state, self._seeded(given), which)
            columns, shifts = meet(meeting, now.columns, now.shifts, given.sizes)
            return cross(step, columns, given.sizes, landed.past), shifts

        return jax.lax.cond(which != 0, met, lambda: (stepped, now.shifts))

    def _seeded(self, given: VariationalProblem) -> Seeded:
        m, p = given.by_state.shape[0], given.by_parameter.shape[0]
        seeds = jnp.concatenate([jnp.zeros((p, m)), jnp.eye(p) * given.sizes], axis=1)
        floors = jnp.concatenate([given.state_floors, given.parameter_floors])
        return Seeded(given.args, seeds, floors, self.active)

    def record(
        self, given: VariationalProblem, now: _Now, time: Scalar
    ) -> tuple[Scalar, list[Scalar]]:
        """The time and the state at the end of an accepted step."""
        return now.kept, [now.t, *jtu.tree_leaves(self.watch.node(given.args, now.state))]

    def _columns(
        self, given: VariationalProblem, now: _Now, step: Differentiated
    ) -> tuple[list[Scalar], Scalar]:
        """The columns after the step, and the largest norm of their errors."""
        inverse = jnp.stack(jtu.tree_leaves(given.units.inverse))

        def step_column(
            column: Scalar, floor: Scalar, forcing: Scalar | None
        ) -> tuple[Scalar, Scalar]:
            end, error = column_step(step, column, forcing)
            sizes = jnp.maximum(jnp.abs(column), jnp.abs(end)) * inverse
            least = SHARE * jnp.max(sizes) + floor
            scaled = error * inverse / (given.tangent_rtol * (sizes + least))
            square = jnp.sum(scaled * scaled) / len(scaled)
            # What an earlier graze left undetermined is in no step's way.
            bad = jnp.where(jnp.isfinite(jnp.sum(column)), jnp.inf, 0.0)
            return end, jnp.where(jnp.isnan(square), bad, square)

        (by_state, by_parameter), worst = now.columns, jnp.zeros(())
        if by_state.shape[0]:
            by_state, squares = jax.lax.map(
                lambda each: step_column(each[0], each[1], None), (by_state, given.state_floors)
            )
            worst = jnp.max(squares)
        if by_parameter.shape[0]:
            rows = jnp.moveaxis(step.by_parameter, -1, 0)

            def carried() -> tuple[Scalar, Scalar]:
                columns, squares = jax.lax.map(
                    lambda each: step_column(each[0], each[1], each[2] * each[3]),
                    (now.columns[1], given.parameter_floors, rows, given.sizes),
                )
                return columns, jnp.max(squares)

            by_parameter, square = jax.lax.cond(
                given.carries_parameters > 0.0, carried, lambda: (now.columns[1], jnp.zeros(()))
            )
            worst = jnp.maximum(worst, square)
        # The step that crosses a switch is too short for them to change.
        return [by_state, by_parameter], jnp.where(
            now.next_t - now.t > 2.0 * nearest(self.watch, now.next_t), jnp.sqrt(worst), 0.0
        )

    def _controller(self, given: VariationalProblem, columns_norm: Scalar) -> SwitchLocator:
        def norm(error: PyTree) -> Scalar:
            return jnp.maximum(rms_norm(error), columns_norm)

        control = step_control(given.rtol, 1e-2 * given.rtol, norm, given.units)
        return SwitchLocator(control, self.watch, corners=True)


def _row(
    keep: Scalar, highest: Scalar, new: Scalar, old: Scalar, peak: Scalar
) -> tuple[Scalar, Scalar]:
    return jnp.where(keep, new, old), jnp.where(highest, new, peak)

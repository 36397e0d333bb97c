"""Solve to a section through diffrax: from a state to the next arrival.

Derivatives are stepped together with the state, and their errors controlled together. A state
within its tolerance does not make its derivatives accurate: they have a norm of their own.
"""

import functools
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, TypeAlias, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import BoolScalarLike, RealScalarLike, Scalar, Time, VectorField, select
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import Recorded, Recording
from jaxbiped.hybrid._scales import units_of
from jaxbiped.solve._accuracy import rms_norm
from jaxbiped.solve._solvers import Projected
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.controllers._step_size import step_control
from jaxbiped.solve.controllers._switch_locator import (
    SwitchLocator,
    SwitchLocatorState,
    nearest,
)
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractMemorylessControl,
    Adapted,
    Attempt,
    first_step,
)
from jaxbiped.solve.rosenbrock._rosenbrock_solver import (
    AbstractMemorylessSolver,
    AbstractRosenbrock,
)
from jaxbiped.variational._rosenbrock_tangents import rosenbrock_tangents
from jaxbiped.variational._saltation import field_switch_values, saltation_at
from jaxbiped.variational._tangents import (
    SectionSolve,
    Seeded,
    Tangents,
    along_columns,
    as_columns,
    is_cut_short,
    plain_args,
    plain_state,
)

SHARE = 0.1
"""Of a column's largest entry: what its smaller entries' errors are measured against."""
_JUST_PAST = 1e-6
"""How far past a maximum a step may have ended that was to end there, in units of time."""
Along: TypeAlias = Callable[
    [Callable[[PyTree, PyTree], PyTree], Tangents, Seeded], tuple[PyTree, PyTree]
]
"""Values of a function of state and arguments, and their derivatives along columns."""


class VariationalField(eqx.Module):
    """The vector field of `Tangents`: f, and J Y + f_p for the columns."""

    field: Callable[..., PyTree]

    def __call__(self, t: Time, y: Tangents, args: Seeded) -> Tangents:
        rate, columns = along_columns(lambda s, a: self.field(t, s, a), y, args)
        return Tangents(rate, as_columns(columns))


class TangentSolver(AbstractMemorylessSolver):
    """Steps a state and its columns: the columns by the exact derivative of the solver's step.

    They share the step's Jacobian and factorisation. Their error estimate is the derivative of
    the state's; `TangentControl` reads it. Steps forwards in time.

    Attributes:
        watch: with the state's own vector field, and its switches.
        solver: any one-step solver that carries nothing from step to step.
        columns_only_choose_steps: whether the columns only choose the steps and are not themselves
            differentiated: for reverse mode, whose derivatives then are these columns' transpose.
    """

    watch: Watch
    solver: diffrax.AbstractAdaptiveSolver[PyTree]
    columns_only_choose_steps: bool = eqx.field(static=True, default=False)
    interpolation_cls: ClassVar[type[diffrax.LocalLinearInterpolation]] = (
        diffrax.LocalLinearInterpolation
    )

    def order(self, terms: Any) -> int | None:
        return self.solver.order(terms)

    def error_order(self, terms: Any) -> RealScalarLike | None:
        return self.solver.error_order(terms)

    def step(
        self,
        terms: Any,
        t0: Time,
        t1: Time,
        y0: Tangents,
        args: Seeded,
        solver_state: None,
        made_jump: BoolScalarLike,
    ) -> tuple[Tangents, Tangents, dict[str, Tangents], None, Any]:
        """One step, as `diffrax.AbstractSolver.step` describes it."""
        del terms, solver_state
        y0 = with_saltation(self.watch, y0, args, made_jump)
        if self.columns_only_choose_steps:
            y1, error = _plain_step(self, t0, t1, y0.state, args.args)
            choosing, errors = jax.lax.stop_gradient(_tangent_step(self, t0, t1, y0, args))
            new, error = Tangents(y1, choosing.columns), Tangents(error, errors.columns)
        else:
            new, error = _tangent_step(self, t0, t1, y0, args)
        crosses = _crosses(self.watch, t0, t1, y0.state, new.state, args.args)
        new, error = _columns_held(crosses, y0, new, error)
        return new, error, dict(y0=y0, y1=new), None, diffrax.RESULTS.successful


def _crosses(
    watch: Watch, t0: Time, t1: Time, before: PyTree, after: PyTree, args: PyTree
) -> Scalar:
    """Whether a step is the short one that crosses a switch where the field is not smooth.

    Its last stage lies behind, where the Jacobian may be any size: saltation is all that its
    columns change by.
    """
    ends = jax.lax.stop_gradient((before, after, args))
    old, new = (field_switch_values(watch, state, ends[2]) for state in ends[:2])
    changed = [(a > 0.0) != (b > 0.0) for a, b in zip(old, new, strict=True)]
    crossed = functools.reduce(jnp.logical_or, changed, jnp.asarray(False))
    return crossed & jax.lax.stop_gradient(t1 - t0 <= 2.0 * nearest(watch, t1))


def _columns_held(
    crosses: Scalar, before: Tangents, after: Tangents, error: Tangents
) -> tuple[Tangents, Tangents]:
    """A step and its error, but where it `crosses` derivatives are those of before, without any."""

    def held(old: Scalar, new: Scalar) -> Scalar:
        return jnp.where(crosses, old + jax.lax.stop_gradient(new - old), new)

    state = jtu.tree_map(held, before.state, after.state)
    columns = jnp.where(crosses, before.columns, after.columns)
    errors = jnp.where(crosses, 0.0, error.columns)
    return Tangents(state, columns), error._replace(columns=errors)


def with_saltation(watch: Watch, y: Tangents, args: Seeded, made_jump: BoolScalarLike) -> Tangents:
    """The columns behind a switch where the field is not smooth, if one has just been passed.

    The state stays what it is, but JAX's own derivatives of it jump as well.
    """
    if not field_switch_values(watch, y.state, args.args):
        return y
    still, held = jax.lax.stop_gradient((y.state, args))
    saltation = saltation_at(watch, still, held, jax.lax.stop_gradient(jnp.asarray(made_jump)))
    rows = saltation.by_state @ y.columns + saltation.by_parameter @ args.seeds
    leaves, structure = jtu.tree_flatten(y.state)
    zero_values = jnp.stack(field_switch_values(watch, y.state, args.args))
    zero_values = zero_values - jax.lax.stop_gradient(zero_values)
    shift = jnp.sum(jnp.where(saltation.which, zero_values, 0.0))
    jumped = [leaf + change * shift for leaf, change in zip(leaves, saltation.change, strict=True)]
    state = jtu.tree_unflatten(structure, jumped)
    return Tangents(state, y.columns + jnp.outer(saltation.change, rows))


def _plain_step(
    solver: TangentSolver, t0: Time, t1: Time, state: PyTree, args: PyTree
) -> tuple[PyTree, PyTree]:
    term = diffrax.ODETerm(solver.watch.field)
    y1, error, *_ = solver.solver.step(term, t0, t1, state, args, None, False)
    return y1, error


@cached_jit  # for its trace cache
def _tangent_step(
    solver: TangentSolver, t0: Time, t1: Time, y0: Tangents, args: Seeded
) -> tuple[Tangents, Tangents]:
    inner = solver.solver
    if isinstance(inner, Projected):
        adaptive = cast(diffrax.AbstractAdaptiveSolver[PyTree], inner.solver)
        bare = TangentSolver(solver.watch, adaptive, solver.columns_only_choose_steps)
        stepped, errors = _tangent_step(bare, t0, t1, y0, args)
        state, columns = along_columns(lambda s, a: inner.project(a, s), stepped, args)
        return Tangents(state, as_columns(columns)), errors
    if isinstance(inner, AbstractRosenbrock):
        found = rosenbrock_tangents(inner.tableau, solver.watch.field, t0, t1, y0, args)
        if found is not None:
            return found
    step = functools.partial(_plain_step, solver, t0, t1)
    (y1, error), (columns, column_errors) = along_columns(step, y0, args)
    return Tangents(y1, as_columns(columns)), Tangents(error, as_columns(column_errors))


class TangentControl(AbstractMemorylessControl):
    """Lets the columns' errors into a controller's norm, with a tolerance of their own.

    An entry's error is measured against its own size, a share of the largest entry of its column,
    and the column's floor, each in its leaf's unit: a column that is zero, or fades away, must not
    choose the steps. The wrapped controller's norm is `worst_norm`.

    Attributes:
        tangent_rtol: tolerance of the columns, relative.
        inverse_units: of the state's leaves, shape (c,).
    """

    tangent_rtol: RealScalarLike
    inverse_units: Scalar

    def adapt(self, attempt: Attempt) -> Adapted:
        inverse = self.inverse_units[:, None]
        size = jnp.maximum(jnp.abs(attempt.y0.columns), jnp.abs(attempt.y1.columns)) * inverse
        floor = SHARE * jnp.max(size, axis=0) + attempt.args.floors
        # The wrapped controller divides by its absolute tolerance; nothing else is left to it.
        scaled = (
            attempt.error.columns * inverse * (self.atol / (self.tangent_rtol * (size + floor)))
        )
        zero_error = jnp.zeros_like(scaled)
        return attempt.by(
            self.controller,
            y0=Tangents(attempt.y0.state, zero_error),
            y1=Tangents(attempt.y1.state, zero_error),
            args=None,
            error=Tangents(attempt.error.state, scaled),
        )


def worst_norm(error: PyTree) -> Scalar:
    """The largest root mean square among the state and each of its columns."""
    if not isinstance(error, Tangents):
        return rms_norm(error)
    squares = jnp.sum(error.columns * error.columns, axis=0) / error.columns.shape[0]
    return jnp.maximum(rms_norm(error.state), jnp.sqrt(jnp.max(squares)))


class Nodes(NamedTuple):
    """The ends of a solve's accepted steps; rows are times and states, one number after the other.

    Attributes:
        start: where the first step begins, shape (1 + c,).
        ends: records of rows, `Recorded` or by lanes a `Recording`. The last one lies just past
            the section.
        arrival: on the section, shape (1 + c,).
        steps: how many there are.
    """

    start: Scalar
    ends: Recorded | Recording
    arrival: Scalar
    steps: Scalar


class SectionArrival(NamedTuple):
    """An arrival at a section, or what came instead.

    Attributes:
        y: state on the section; with its columns there, where the solve carried any: the motion
            of the arrival is taken off.
        time: duration of the solve [s].
        time_columns: derivatives of the time of arrival, shape (n,).
        code: 0 for an arrival, else that of an `Ending`.
        peak: largest value of the watched quantity, 0 where there is none; `peak_columns` its
            derivatives, shape (n,), where the solve carried columns.
        jumps: steps that ended past a switch where the vector field itself jumps.
        grazes: steps in which a switch was grazed: derivatives are not determined.
        attempted: number of steps attempted.
        nodes: the ends of the accepted steps, where saved.
    """

    y: PyTree
    time: Scalar
    time_columns: PyTree
    code: Scalar
    peak: Scalar
    peak_columns: PyTree
    jumps: Scalar
    grazes: Scalar
    attempted: Scalar
    nodes: Nodes | None

    @property
    def undetermined(self) -> Scalar:
        """Whether derivatives of the arrival are not to be had (boolean)."""
        return (self.grazes > 0) | is_cut_short(self.code)


def solve_to_section(
    how: SectionSolve,
    y0: PyTree,
    args: PyTree,
    *,
    columns_only_choose_steps: bool = False,
    save_nodes: bool = False,
) -> SectionArrival:
    """Solves from `y0` through diffrax.

    With `y0` a `Tangents` and `args` a `Seeded` the columns are carried along.
    """
    watch, solver, precision = how.watch, how.solver, how.precision
    carries = isinstance(y0, Tangents)
    norm = worst_norm if carries else rms_norm
    units = units_of(plain_args(args), plain_state(y0))
    # Columns come to the norm as the tangents' own control has scaled them.
    carried = units
    if carries:
        one = jnp.ones((), y0.columns.dtype)
        carried = units._replace(inverse=Tangents(units.inverse, one))
    controller = step_control(precision.rtol, 1e-2 * precision.rtol, norm, carried)
    field: VectorField = watch.field
    if carries:
        inverse = jnp.stack(jtu.tree_leaves(units.inverse))
        controller = TangentControl(controller, precision.tangent_rtol, inverse)
        solver = TangentSolver(watch, solver, columns_only_choose_steps)
        field = VariationalField(watch.field)
    end = diffrax.SubSaveAt(t1=True)
    every = diffrax.SubSaveAt(t0=True, steps=True, fn=_plain_node)
    subs = [end, every] if save_nodes else [end]
    limit = jnp.asarray(how.max_time, dtype=jnp.result_type(*jtu.tree_leaves(y0)))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        solver,
        t0=jnp.zeros_like(limit),
        t1=limit,
        dt0=first_step(limit, units.time),
        y0=y0,
        args=args,
        saveat=diffrax.SaveAt(subs=subs, controller_state=True),
        stepsize_controller=SwitchLocator(
            controller, watch, state_of=plain_state, args_of=plain_args
        ),
        max_steps=how.max_solver_steps,
        throw=False,
    )
    times: PyTree = solution.ts
    states: PyTree = solution.ys
    landed: PyTree = solution.controller_state
    last = jtu.tree_map(lambda leaf: leaf[-1], states[0])
    if carries:
        last = with_saltation(watch, last, args, landed.saltation_pending)
    y, time, time_columns = onto_section(watch, last, times[0][-1], args)
    peak, peak_columns = jnp.zeros(()), None
    if carries:
        peak, rows = peak_of(watch, landed.at_peak, args)
        # Columns do not tell how a load right behind a jump changes.
        peak_columns = jnp.where(landed.jumps_at_peak, jnp.nan, rows)
        peak, peak_columns = with_peak_at_end(watch, (peak, peak_columns), y, args)
    return SectionArrival(
        y=y,
        time=time,
        time_columns=time_columns,
        code=_code(solution, landed),
        peak=peak,
        peak_columns=peak_columns,
        jumps=landed.jumps,
        grazes=landed.grazes,
        attempted=solution.stats["num_steps"],
        nodes=_nodes(times[1], states[1], time, y) if save_nodes else None,
    )


def _nodes(times: Scalar, states: PyTree, time: Scalar, y: PyTree) -> Nodes:
    """From times and states of which the first are those of the start; infinite beyond the last."""
    rows = jnp.stack([times, *jtu.tree_leaves(states)], axis=-1)
    arrival = jnp.stack([time, *jtu.tree_leaves(plain_state(y))])
    steps = jnp.sum(jnp.isfinite(times)) - 1
    ends = Recorded(rows[1:], steps)  # type: ignore[arg-type]
    return Nodes(rows[0], ends, arrival, steps)


def _plain_node(t: Time, y: PyTree, args: PyTree) -> PyTree:
    return y.state if isinstance(y, Tangents) else y


def _code(solution: diffrax.Solution, landed: SwitchLocatorState) -> Scalar:
    results = diffrax.RESULTS
    out_of_steps = solution.result == results.max_steps_reached
    ended = jnp.where(out_of_steps, int(Ending.OUT_OF_STEPS), int(Ending.SOLVER_FAILED))
    ended = jnp.where(solution.result == results.successful, int(Ending.TIMED_OUT), ended)
    ended = jnp.where(landed.code != 0, landed.code, ended)
    return jnp.where(landed.arrived, 0, ended)


def arrival_at(watch: Watch, state: PyTree, args: PyTree) -> tuple[PyTree, Scalar]:
    """The state on the section just before `state`, and how long before [s]."""
    assert watch.section is not None
    section = watch.section

    def back(y: PyTree, rate: PyTree, time: Scalar) -> PyTree:
        return jtu.tree_map(lambda s, r: s - time * r, y, rate)

    def newton(y: PyTree) -> tuple[Scalar, PyTree]:
        rate = watch.field(jnp.zeros(()), y, args)
        value, slope = jax.jvp(lambda s: section(args, s)[0], (y,), (rate,))
        return value / slope, rate

    past, rate = newton(state)
    # The overshoot is a small part of a step: a midpoint step back, and what that leaves.
    middle = watch.field(jnp.zeros(()), back(state, rate, 0.5 * past), args)
    near = back(state, middle, past)
    # Without this second iteration derivatives would be wrong by a part as large as the overshoot.
    left, rate = newton(near)
    return back(near, rate, left), past + left


def onto_section(
    watch: Watch, y: PyTree, t: Scalar, args: PyTree, along: Along = along_columns
) -> tuple[PyTree, Scalar, PyTree]:
    """Takes the small overshoot back; its derivatives follow the arrival.

    Gives what is on the section, the time, and the time's derivatives. `along` differentiates
    along the columns.
    """
    time = jax.lax.stop_gradient(t)

    def arrival(state: PyTree, scene: PyTree) -> tuple[PyTree, Scalar]:
        reached, past = arrival_at(watch, state, scene)
        return reached, time - past

    if not isinstance(y, Tangents):
        return *arrival(y, args), None
    assert isinstance(args, Seeded)
    (state, at), (columns, time_columns) = along(arrival, y, args)
    return Tangents(state, as_columns(columns)), at, time_columns


def peak_of(
    watch: Watch, at_peak: Tangents, args: Seeded, along: Along = along_columns
) -> tuple[Scalar, Scalar]:
    """The largest load and its derivatives.

    The solve landed just past the moment at which the load's rate is zero; that little time is
    taken back, for the load's rate changes fast during an impact. Where it is largest at the start
    of the solve it stays as it is.
    """
    if watch.peak is None:
        return jnp.zeros(()), jnp.zeros(args.seeds.shape[1])
    load = watch.peak

    def value(y: PyTree, a: PyTree) -> Scalar:
        return load(a, y)

    def rate(y: PyTree, a: PyTree) -> Scalar:
        velocity = watch.field(jnp.zeros(()), y, a)
        return jax.jvp(lambda y: load(a, y), (y,), (velocity,))[1]

    highest, row = along(value, at_peak, args)
    slope, slope_row = along(rate, at_peak, args)
    state = at_peak.state
    velocity = watch.field(jnp.zeros(()), state, args.args)
    curvature = jax.jvp(lambda y: rate(y, args.args), (state,), (velocity,))[1]
    is_maximum = curvature < 0.0
    past = jnp.where(is_maximum, slope / jnp.where(is_maximum, curvature, 1.0), 0.0)
    past = jnp.where(jnp.abs(past) < _JUST_PAST * watch.time_unit, past, 0.0)
    return highest - 0.5 * past * slope, row - past * slope_row


def with_peak_at_end(
    watch: Watch,
    peak: tuple[Scalar, Scalar],
    end: Tangents,
    args: Seeded,
    along: Along = along_columns,
) -> tuple[Scalar, Scalar]:
    """The largest load and its derivatives, of a peak before and of the arrival on the section."""
    if watch.peak is None or watch.section is None:
        return peak
    load = watch.peak
    last = along(lambda y, a: load(a, y), end, args)
    return select(last[0] > peak[0], last, peak)

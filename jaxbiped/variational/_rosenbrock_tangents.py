"""Tangents of a Rosenbrock step: its exact derivative along many directions.

`rosenbrock_tangents` takes them at once for XLA, which multiplies matrices of directions;
`column_step` takes one after the other for lanes.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, VectorField
from jaxbiped.compiler import fusion_barrier, jacobian, without_barriers
from jaxbiped.solve.rosenbrock._linearisation import Components, ImplicitForm, split
from jaxbiped.solve.rosenbrock._rosenbrock_solver import Stages, stages_of
from jaxbiped.solve.rosenbrock._tableau_form import RosenbrockTableau, end_weights, error_weights
from jaxbiped.variational._tangents import Seeded, Tangents, active_leaves, with_active

_KeptRates: TypeAlias = Callable[[Components, Sequence[Scalar]], Components]
"""Rates of the kept components, by all components and the active parameters."""


def rosenbrock_tangents(
    tableau: RosenbrockTableau,
    field: VectorField,
    t0: Time,
    t1: Time,
    y0: Tangents,
    args: Seeded,
) -> tuple[Tangents, Tangents] | None:
    """A step of a state and its columns, and the error estimates of both.

    With W = I − g J, g = h γ, and the stages of `RosenbrockTableau`, differentiating gives
    W dU_i = g (A_i dY_i + B_i dY_0) + γ Σ_j c_ij dU_j, where A_i is the derivative of f at the
    stage's argument Y_i, B_i that of J(y) u_i at the start, and parameters count among the
    arguments. All A_i and B_i are found at once, as the derivatives along unit vectors; the rest
    is small matrices times the columns.

    None where this does not apply: arrays in the state, many scalars, or explicit time.
    """
    start, join = split(y0.state, field)
    parameters = active_leaves(args)
    # `split` glues many scalars into one array, too.
    if any(jnp.ndim(leaf) for leaf in (*start, *jax.tree.leaves(y0.state))):
        return None
    span = jnp.asarray(t1 - t0, dtype=jnp.result_type(*start))
    stages, kept_rates, order = _solved_stages(
        tableau, field, jnp.asarray(t0), span, (start, join), args
    )
    if any(rate is not None for rate in stages.lin.time_derivative()):
        return None
    at_stages, by_curvature = _derivatives(tableau, stages, kept_rates, order, parameters)
    count = len(start)
    columns = _rows(y0.columns, order)
    seeded = jnp.concatenate([columns, args.seeds])

    back = [order.index(i) for i in range(count)]

    def combined() -> tuple[Components, Components, Scalar, Scalar]:
        constant = by_curvature @ seeded + at_stages[..., count:] @ args.seeds
        changes = _column_stages(tableau, stages, at_stages[..., :count], constant, columns)
        end, error = end_weights(tableau), error_weights(tableau)
        return (
            [y + u for y, u in zip(start, stages.weighted(end), strict=True)],
            stages.weighted(error),
            _rows(columns + _weighted_sum(end, changes), back),
            _rows(_weighted_sum(error, changes), back),
        )

    end, error, columns, column_errors = fusion_barrier(stages.step != 0.0, combined)
    return Tangents(join(end), columns), Tangents(join(error), column_errors)


def _solved_stages(
    tableau: RosenbrockTableau,
    field: VectorField,
    t: Scalar,
    span: Scalar,
    parts: tuple[Components, Callable[[Components], PyTree]],
    args: Seeded,
) -> tuple[Stages, _KeptRates, list[int]]:
    """The stages of a step from a split state, the kept rates, and the components' order.

    First come the components whose rate is a component, then the kept ones.
    """
    start, join = parts
    parameters = active_leaves(args)

    def rates(t: Scalar, y: Components, q: Sequence[Scalar]) -> Components:
        return split(field(t, join(y), with_active(args, list(q))), field)[0]

    form = ImplicitForm(field, join, args.args)
    stages = stages_of(tableau, lambda t, y: rates(t, y, parameters), t, start, span, span, form)
    kept = kept_in_order(stages)

    def kept_rates(y: Components, q: Sequence[Scalar]) -> Components:
        every = rates(t, y, q)
        return [every[i] for i in kept]

    return stages, kept_rates, [*stages.direct, *kept]


def _stage_arguments(tableau: RosenbrockTableau, stages: Stages) -> list[Components]:
    """Arguments of the field at all stages, the first of them the start."""
    moved = (
        [y + u for y, u in zip(stages.start, stages.weighted(row), strict=True)]
        for row in tableau.a
    )
    return [stages.start, *moved]


def _derivatives(
    tableau: RosenbrockTableau,
    stages: Stages,
    kept_rates: _KeptRates,
    order: Sequence[int],
    parameters: Sequence[Scalar],
) -> tuple[Scalar, Scalar]:
    """A_i and B_i of all stages, each of shape (stages, kept, components + parameters).

    Components are in the given order.
    By reverse mode: the kept rates are few, and all stages are done at once.
    """
    start, size = stages.start, len(tableau.alpha)
    arguments = _stage_arguments(tableau, stages)
    points = [jnp.stack(column) for column in zip(*arguments, strict=True)]
    increments = [stages.weighted(row) for row in np.eye(size)]
    directions = [jnp.stack(column) for column in zip(*increments, strict=True)]

    def directional_derivative(y: Components, q: Sequence[Scalar], along: Components) -> Components:
        return jax.jvp(lambda y: kept_rates(y, q), (y,), (along,))[1]

    def at_point(y: Components, _: Components) -> PyTree:
        return jax.vjp(kept_rates, y, list(parameters))[1]

    def at_start(_: Components, along: Components) -> PyTree:
        return jax.vjp(lambda y, q: directional_derivative(y, q, along), start, list(parameters))[1]

    unit = list(jnp.eye(len(stages.kept), dtype=points[0].dtype))
    moves = stages.step != 0.0

    def gradients(of: Callable[[Components, Components], PyTree]) -> Scalar:
        pulls = fusion_barrier(moves, lambda: jax.vmap(of)(points, directions))

        def pulled() -> PyTree:
            # A linear field leaves nothing to pull through: the size is said, not read off.
            every = jax.vmap(lambda pull: jax.vmap(lambda *e: pull(list(e)))(*unit), axis_size=size)
            return every(pulls)

        state_part, parameter_part = fusion_barrier(moves, pulled)
        return jnp.stack([*(state_part[i] for i in order), *parameter_part], axis=-1)

    return gradients(at_point), gradients(at_start)


def _column_stages(
    tableau: RosenbrockTableau,
    stages: Stages,
    at_stages: Scalar,
    constant: Scalar,
    columns: Scalar,
) -> list[Scalar]:
    """dU_i of every stage, each of shape (components, n)."""
    step, led = stages.step, len(stages.direct)
    by_kept, by_direct = stage_matrices(stages)
    increments: list[Scalar] = []
    for i in range(len(tableau.alpha)):
        argument = columns
        right = step * constant[i]
        if i:
            argument = columns + _weighted_sum(tableau.a[i - 1], increments)
            memory = _weighted_sum([tableau.gamma * c for c in tableau.c[i - 1]], increments)
            right = right + memory[led:]
        right = right + step * (at_stages[i] @ argument)
        through = step * argument[led : 2 * led]
        if i:
            through = through + memory[:led]
        solved = by_kept @ right + by_direct @ through
        increments.append(jnp.concatenate([through + step * solved[:led], solved]))
    return increments


def kept_in_order(stages: Stages) -> list[int]:
    """The kept components: first those that the direct ones follow, in the same order."""
    sources = list(stages.direct.values())
    return [*sources, *(i for i in stages.kept if i not in sources)]


def _rows(matrix: Scalar, order: Sequence[int]) -> Scalar:
    """The rows of a matrix in another order; by slices, which XLA runs faster than a gather."""
    if list(order) == sorted(order):
        return matrix
    return jnp.concatenate([matrix[i : i + 1] for i in order])


def stage_matrices(stages: Stages) -> tuple[Scalar, Scalar]:
    """What a stage's solution is of right sides: of the kept components in order, of the direct."""
    places = [stages.kept.index(i) for i in kept_in_order(stages)]
    found = stages.lin.solution_matrices(stages.step_matrix)
    by_kept, by_direct = (_rows(each, places) for each in found)
    return _rows(by_kept.T, places).T, by_direct


def _weighted_sum(weights: Sequence[float], values: Sequence[Scalar]) -> Scalar:
    terms = [w * v for w, v in zip(weights, values, strict=False) if w != 0.0]
    return sum(terms[1:], terms[0]) if terms else jnp.zeros_like(values[0])


class Differentiated(NamedTuple):
    """A step and what the derivative of it needs (see `rosenbrock_tangents` for the equations).

    Components are in the order `order`: first those whose rate is a component, then the kept ones.

    Attributes:
        tableau, stages: of the step.
        end, error: the state's new value and its error estimate.
        order: the components' order.
        by_state: derivatives A_i of the kept rates at the stages, shape (stages, kept, c).
        by_curvature: derivatives B_i, likewise.
        by_parameter: A_i + B_i for the active parameters, shape (stages, kept, p).
    """

    tableau: RosenbrockTableau
    stages: Stages
    end: PyTree
    error: PyTree
    order: list[int]
    by_state: Scalar
    by_curvature: Scalar
    by_parameter: Scalar


def differentiate_step(
    tableau: RosenbrockTableau,
    field: VectorField,
    t0: Scalar,
    t1: Scalar,
    y0: PyTree,
    args: Seeded,
    *,
    carries_parameters: Scalar | bool,
) -> Differentiated:
    """A step of an autonomous system of scalars, with all that its derivatives share.

    Derivatives with respect to the p active leaves of the arguments are zero unless
    `carries_parameters`.
    """
    start, join = split(y0, field)
    with without_barriers():
        stages, kept_rates, order = _solved_stages(
            tableau, field, t0, jnp.asarray(t1 - t0), (start, join), args
        )
        by_state, by_curvature, by_parameter = _column_derivatives(
            tableau, stages, kept_rates, active_leaves(args), carries_parameters
        )
    return Differentiated(
        tableau=tableau,
        stages=stages,
        end=join(
            [y + u for y, u in zip(start, stages.weighted(end_weights(tableau)), strict=True)]
        ),
        error=join(stages.weighted(error_weights(tableau))),
        order=order,
        by_state=_pick(by_state, order),
        by_curvature=_pick(by_curvature, order),
        by_parameter=by_parameter,
    )


def _pick(array: Scalar, places: Sequence[int]) -> Scalar:
    return jnp.stack([array[..., i] for i in places], axis=-1)


def _column_derivatives(
    tableau: RosenbrockTableau,
    stages: Stages,
    kept_rates: _KeptRates,
    parameters: Sequence[Scalar],
    carries_parameters: Scalar | bool,
) -> tuple[Scalar, Scalar, Scalar]:
    """Of all stages A_i and B_i by components (stages, kept, c), A_i + B_i by parameters."""
    start, size = stages.start, len(tableau.alpha)
    points = _stage_arguments(tableau, stages)
    directions = [stages.weighted(row) for row in np.eye(size)]
    count = len(start)

    def rates(z: Components) -> Components:
        return kept_rates(z[:count], z[count:])

    def apart(found: Scalar, constant: Scalar | float) -> tuple[Scalar, Scalar]:
        """With respect to components, and to parameters, where `constant` is added."""
        no_parameters = jnp.zeros((len(found), len(parameters)))
        by_parameter = constant + found[:, count:]
        return found[:, :count], jax.lax.cond(
            carries_parameters, lambda: by_parameter, lambda: no_parameters
        )

    def at_point(point: Scalar) -> tuple[Scalar, Scalar]:
        return apart(jacobian(rates, [*point, *parameters]), 0.0)

    def at_start(both: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
        along, constant = list(both[0]), both[1]

        def directional_derivative(z: Components) -> Components:
            return jax.jvp(lambda y: kept_rates(y, z[count:]), (z[:count],), (along,))[1]

        return apart(jacobian(directional_derivative, [*start, *parameters]), constant)

    # Two short loops: what one keeps in registers and caches the other one need not.
    stacked = [jnp.stack([jnp.stack(each) for each in array]) for array in (points, directions)]
    by_point, constant = jax.lax.map(at_point, stacked[0])
    by_start, by_parameter = jax.lax.map(at_start, (stacked[1], constant))
    return by_point, by_start, by_parameter


def column_step(
    step: Differentiated, column: Scalar, forcing: Scalar | None
) -> tuple[Scalar, Scalar]:
    """The derivative of a step along one direction: of the new state, and of its error estimate.

    `column` are the components' derivatives, shape (c,), in their own order; `forcing` that of the
    kept rates at every stage by a parameter, shape (stages, kept), None for a direction of state
    alone.
    """
    tableau, stages, order = step.tableau, step.stages, step.order
    g, led = stages.step, len(stages.direct)
    start = jnp.stack([column[i] for i in order])
    zero_state = jnp.zeros_like(start)
    by_kept, by_direct = stage_matrices(stages)
    increments: list[Scalar] = []
    for i in range(len(tableau.alpha)):
        argument = _sum_from(tableau.a[i - 1] if i else (), increments, start)
        coefficients = [tableau.gamma * c for c in tableau.c[i - 1]] if i else ()
        memory = _sum_from(coefficients, increments, zero_state)
        if i == 0:
            # Its argument is the start itself: the matrices are summed once for all directions.
            right = (step.by_curvature[i] + step.by_state[i]) @ start
        else:
            right = step.by_curvature[i] @ start + step.by_state[i] @ argument
        if forcing is not None:
            right = right + forcing[i]
        through = g * argument[led : 2 * led] + memory[:led]
        solved = by_kept @ (g * right + memory[led:]) + by_direct @ through
        followers = through + g * solved[:led]
        increments.append(jnp.concatenate([followers, solved]))
    back = [order.index(i) for i in range(len(column))]
    end = _sum_from(end_weights(tableau), increments, start)
    error = _sum_from(error_weights(tableau), increments, zero_state)
    return jnp.stack([end[i] for i in back]), jnp.stack([error[i] for i in back])


def cross(
    step: Differentiated, columns: Sequence[Scalar], sizes: Scalar, past: Scalar
) -> list[Scalar]:
    """Columns after a step so short that it is linear, which ends a time `past` a switch.

    By the Jacobians at its start and its end, each for its time: a stage beyond the switch would
    have its Jacobian for all of the step. The m directions of state, (m, c), then those of p
    parameters, which move by their `sizes`.
    """
    order, led = step.order, len(step.stages.direct)
    back = [order.index(i) for i in range(len(order))]
    before = step.stages.step / step.tableau.gamma - past

    def advance(column: Scalar, forcing: Scalar) -> Scalar:
        start = jnp.stack([column[i] for i in order])
        direct = start[led : 2 * led]
        for time, i in ((before, 0), (past, -1)):
            kept = step.by_state[i] @ start + forcing[i]
            start = start + time * jnp.concatenate([direct, kept])
        return jnp.stack([start[i] for i in back])

    rows = jnp.moveaxis(step.by_parameter, -1, 0) * sizes[:, None, None]
    idle = jnp.zeros((len(columns[0]), *rows.shape[1:]))
    pairs = zip(columns, (idle, rows), strict=True)
    return [
        jax.lax.map(lambda each: advance(*each), pair) if len(pair[0]) else pair[0]
        for pair in pairs
    ]


def _sum_from(weights: Sequence[float], increments: Sequence[Scalar], start: Scalar) -> Scalar:
    """start + Σ weights_j increments_j, one behind the other: sums that begin alike are shared."""
    for weight, increment in zip(weights, increments, strict=False):
        if weight != 0.0:
            start = start + weight * increment
    return start

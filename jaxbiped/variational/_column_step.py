"""Column step: the derivative of a Rosenbrock step, one direction at a time.

For lanes, which carry one direction after the other; `_rosenbrock_tangents` takes all at once for
XLA.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, VectorField
from jaxbiped.compiler import jacobian
from jaxbiped.solve._fusion_barrier import without_barriers
from jaxbiped.solve.rosenbrock._linearisation import Components, ImplicitForm, split
from jaxbiped.solve.rosenbrock._rosenbrock_solver import Stages, stages_of
from jaxbiped.solve.rosenbrock._tableau_form import RosenbrockTableau, end_weights, error_weights
from jaxbiped.variational._rosenbrock_tangents import kept_in_order, stage_matrices
from jaxbiped.variational._tangents import Seeded, active_leaves, with_active


class Differentiated(NamedTuple):
    """A step and what the derivative of it needs (see `rosenbrock_columns` for the equations).

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
    parameters = active_leaves(args)

    def rates(t: Scalar, y: Components, q: Sequence[Scalar]) -> Components:
        return split(field(t, join(y), with_active(args, list(q))), field)[0]

    span = jnp.asarray(t1 - t0)
    with without_barriers():
        form = ImplicitForm(field, join, args.args)
        stages = stages_of(
            tableau, lambda t, y: rates(t, y, parameters), t0, start, span, span, form
        )
        order = [*stages.direct, *kept_in_order(stages)]

        def kept_rates(y: Components, q: Sequence[Scalar]) -> Components:
            every = rates(t0, y, q)
            return [every[i] for i in kept_in_order(stages)]

        by_state, by_curvature, by_parameter = _derivatives(
            tableau, stages, kept_rates, parameters, carries_parameters
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


def _derivatives(
    tableau: RosenbrockTableau,
    stages: Stages,
    kept_rates: Callable[[Components, Sequence[Scalar]], Components],
    parameters: Sequence[Scalar],
    carries_parameters: Scalar | bool,
) -> tuple[Scalar, Scalar, Scalar]:
    """Of all stages A_i and B_i by components (stages, kept, c), A_i + B_i by parameters."""
    start, size = stages.start, len(tableau.alpha)
    points = [start] + [
        [y + u for y, u in zip(start, stages.weighted(row), strict=True)] for row in tableau.a
    ]
    unit = [[1.0 if i == j else 0.0 for j in range(size)] for i in range(size)]
    directions = [stages.weighted(row) for row in unit]
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
        argument = _weighted_sum(tableau.a[i - 1] if i else (), increments, start)
        coefficients = [tableau.gamma * c for c in tableau.c[i - 1]] if i else ()
        memory = _weighted_sum(coefficients, increments, zero_state)
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
    end = _weighted_sum(end_weights(tableau), increments, start)
    error = _weighted_sum(error_weights(tableau), increments, zero_state)
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


def _weighted_sum(weights: Sequence[float], increments: Sequence[Scalar], start: Scalar) -> Scalar:
    """start + Σ weights_j increments_j, one behind the other: sums that begin alike are shared."""
    for weight, increment in zip(weights, increments, strict=False):
        if weight != 0.0:
            start = start + weight * increment
    return start

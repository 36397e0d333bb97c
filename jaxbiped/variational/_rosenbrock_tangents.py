"""Tangents of a Rosenbrock step: its exact derivative along many directions at once.

For XLA, which multiplies matrices of directions; `_column_step` takes them one by one for lanes.
"""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, VectorField
from jaxbiped.solve._fusion_barrier import fusion_barrier
from jaxbiped.solve.rosenbrock._linearisation import Components, ImplicitForm, split
from jaxbiped.solve.rosenbrock._rosenbrock_solver import Stages, stages_of
from jaxbiped.solve.rosenbrock._tableau_form import RosenbrockTableau, end_weights, error_weights
from jaxbiped.variational._tangents import Seeded, Tangents, active_leaves, with_active


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

    def rates(t: Scalar, y: Components, q: Sequence[Scalar]) -> Components:
        return split(field(t, join(y), with_active(args, q)), field)[0]

    t = jnp.asarray(t0)
    span = jnp.asarray(t1 - t0, dtype=jnp.result_type(*start))
    form = ImplicitForm(field, join, args.args)
    stages = stages_of(tableau, lambda t, y: rates(t, y, parameters), t, start, span, span, form)
    if any(rate is not None for rate in stages.lin.time_derivative()):
        return None

    followers, kept = list(stages.direct), kept_in_order(stages)

    def kept_rates(y: Components, q: Sequence[Scalar]) -> Components:
        all_rates = rates(t, y, q)
        return [all_rates[i] for i in kept]

    order = [*followers, *kept]
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


def _derivatives(
    tableau: RosenbrockTableau,
    stages: Stages,
    kept_rates: Callable[[Components, Sequence[Scalar]], Components],
    order: Sequence[int],
    parameters: Sequence[Scalar],
) -> tuple[Scalar, Scalar]:
    """A_i and B_i of all stages, each of shape (stages, kept, components + parameters).

    Components are in the given order.
    By reverse mode: the kept rates are few, and all stages are done at once.
    """
    start, size = stages.start, len(tableau.alpha)
    rows = [np.zeros(size), *(np.pad(row, (0, size - len(row))) for row in tableau.a)]
    arguments = [
        [y + u for y, u in zip(start, stages.weighted(row), strict=True)] for row in rows[1:]
    ]
    points = [jnp.stack(column) for column in zip(start, *arguments, strict=True)]
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

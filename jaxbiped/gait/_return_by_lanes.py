"""The return map by lanes: all directions of a derivative share one solve."""

from typing import cast

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._poincare_map import PARAMETER_FLOOR, STATE_FLOOR
from jaxbiped.gait._return_by_xla import NO_REVERSE, full_tangents, reset_on_arrival
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._units import units_of
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._tangents import Seeded, Tangents
from jaxbiped.variational._variational_problem import VariationalSolution
from jaxbiped.variational._variational_solve import solve_variational


@eqx.filter_custom_jvp
def forward_by_lanes(
    spec: ReturnMapSpec, precision: Precision, args: PyTree, state: PyTree
) -> tuple[PyTree, Scalar, Scalar]:
    found = _solve(spec, precision, args, state, (), ())
    return reset_on_arrival(spec, args, found.state, found.t, found.code)


@forward_by_lanes.def_jvp
def _forward_by_lanes_jvp(
    primals: tuple[PyTree, ...], tangents: tuple[PyTree, ...]
) -> tuple[PyTree, PyTree]:
    spec, precision, args, state = primals
    _, _, args_dot, state_dot = tangents
    state_dots, args_dots = _leaves_with_none(state_dot, state), _leaves_with_none(args_dot, args)
    places = tuple(i for i, dot in enumerate(state_dots) if dot is not None)
    active = tuple(i for i, dot in enumerate(args_dots) if dot is not None)
    found = _solve(spec, precision, args, state, places, active)
    sizes = _sizes(args, active)
    dots = [state_dots[i] for i in places]
    dots += [args_dots[i] / size for i, size in zip(active, sizes, strict=True)]
    along = jnp.stack(dots) if dots else jnp.zeros(0)
    arrived = jtu.tree_unflatten(jtu.tree_structure(state), list(along @ found.columns))

    def reset_map(args: PyTree, y: PyTree) -> PyTree:
        return reset_on_arrival(spec, args, y, found.t, found.code)[0]

    _, end_dot = jax.jvp(reset_map, (args, found.state), (full_tangents(args_dot, args), arrived))
    end_dot, time_dot = eqxi.nondifferentiable_backward(
        (end_dot, along @ found.time_columns), msg=NO_REVERSE
    )
    return forward_by_lanes(spec, precision, args, state), (end_dot, time_dot, None)


@eqx.filter_custom_vjp
def _reversible(
    given: tuple[PyTree, PyTree], spec: ReturnMapSpec, precision: Precision
) -> tuple[PyTree, Scalar, Scalar]:
    args, state = given
    return forward_by_lanes(spec, precision, args, state)


def reverse_by_lanes(
    spec: ReturnMapSpec, precision: Precision, args: PyTree, state: PyTree
) -> tuple[PyTree, Scalar, Scalar]:
    """In reverse mode: the columns, of just what is differentiated, are known and transposed."""
    return _reversible((args, state), spec, precision)


@_reversible.def_fwd
def _reversible_fwd(
    perturbed: PyTree, given: tuple[PyTree, PyTree], spec: ReturnMapSpec, precision: Precision
) -> tuple[PyTree, VariationalSolution]:
    args, state = given
    active, places = (_places(part) for part in perturbed)
    found = _solve(spec, precision, args, state, places, active)
    return reset_on_arrival(spec, args, found.state, found.t, found.code), found


@_reversible.def_bwd
def _reversible_bwd(
    found: VariationalSolution,
    cotangents: PyTree,
    perturbed: PyTree,
    given: tuple[PyTree, PyTree],
    spec: ReturnMapSpec,
    precision: Precision,
) -> tuple[PyTree, PyTree]:
    del precision
    args, state = given
    active, places = (_places(part) for part in perturbed)
    end_bar, time_bar, _ = cotangents

    def reset_map(args: PyTree, y: PyTree) -> PyTree:
        return reset_on_arrival(spec, args, y, found.t, found.code)[0]

    _, pull = jax.vjp(reset_map, args, found.state)
    args_bar, arrived_bar = pull(full_tangents(end_bar, state))
    along = found.columns @ jnp.stack(jtu.tree_leaves(arrived_bar))
    if time_bar is not None:
        along = along + found.time_columns * time_bar
    by_state = dict(zip(places, along, strict=False))
    by_args = zip(active, along[len(places) :], _sizes(args, active), strict=True)
    own = jtu.tree_leaves(args_bar)
    by_parameter = {i: own[i] + bar / size for i, bar, size in by_args}
    return _sparse_tree(args, by_parameter), _sparse_tree(state, by_state)


def _places(perturbed: PyTree) -> tuple[int, ...]:
    """Positions of the leaves that are differentiated."""
    return tuple(i for i, is_so in enumerate(jtu.tree_leaves(perturbed)) if is_so)


def _sparse_tree(like: PyTree, known: dict[int, Scalar]) -> PyTree:
    """These leaves, and None for the others."""
    leaves, structure = jtu.tree_flatten(like)
    return jtu.tree_unflatten(structure, [known.get(i) for i in range(len(leaves))])


def _solve(
    spec: ReturnMapSpec,
    precision: Precision,
    args: PyTree,
    state: PyTree,
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> VariationalSolution:
    """Columns by these leaves of the state, then by the logarithms of these of the arguments.

    NaN where they are not determined.
    """
    m, p = len(places), len(active)
    columns = np.zeros((len(jtu.tree_leaves(state)), m + p))
    columns[list(places), range(m)] = 1.0
    inverse = jtu.tree_leaves(units_of(args, state).inverse)
    floors = jnp.asarray([*(STATE_FLOOR * inverse[i] for i in places), *[PARAMETER_FLOOR] * p])
    found, _ = solve_variational(
        spec.watch(args, state, peak=False),
        cast(AbstractRosenbrock, spec.solver),
        Tangents(state, jnp.asarray(columns)),
        Seeded(args, jnp.zeros((p, m + p)), floors, active),
        jnp.stack(_sizes(args, active)) if active else jnp.zeros(0),
        precision=precision,
        max_time=spec.max_time,
        max_solver_steps=spec.max_solver_steps,
    )
    nan = jnp.where(found.undetermined, jnp.nan, 0.0)
    return found._replace(columns=found.columns + nan, time_columns=found.time_columns + nan)


def _sizes(args: PyTree, active: tuple[int, ...]) -> list[Scalar]:
    """By how much parameters move: their own size, or one where they are zero."""
    leaves = jtu.tree_leaves(args)
    return [jnp.where(leaves[i] == 0.0, 1.0, leaves[i]) for i in active]


def _leaves_with_none(tangents: PyTree, like: PyTree) -> list[PyTree]:
    """Tangents of every leaf, None where JAX left them out."""
    if tangents is None:
        return [None] * len(jtu.tree_leaves(like))
    return jtu.tree_leaves(tangents, is_leaf=lambda leaf: leaf is None)

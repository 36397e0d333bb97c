"""The return map by diffrax: forward with tangents of its own, and in reverse."""

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar, select
from jaxbiped.gait._poincare_map import PARAMETER_FLOOR, STATE_FLOOR
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._units import units_of
from jaxbiped.variational._solve_to_section import solve_to_section
from jaxbiped.variational._tangents import Seeded, Tangents

NO_REVERSE = (
    "gradient = Forward() carries tangents along the motion and has no reverse mode: pass "
    "gradient=Reverse() to return_map, or differentiate by jax.jvp or jax.jacfwd."
)


@eqx.filter_custom_jvp
def forward_by_xla(
    spec: ReturnMapSpec, precision: Precision, args: PyTree, state: PyTree
) -> tuple[PyTree, Scalar, Scalar]:
    watch = spec.watch(args, state, peak=False)
    found = solve_to_section(
        watch,
        spec.solver,
        state,
        args,
        precision=precision,
        max_time=spec.max_time,
        max_solver_steps=spec.max_solver_steps,
    )
    return reset_on_arrival(spec, args, found.y, found.time, found.code)


@forward_by_xla.def_jvp
def _by_xla_forward_jvp(
    primals: tuple[PyTree, ...], tangents: tuple[PyTree, ...]
) -> tuple[PyTree, PyTree]:
    spec, precision, args, state = primals
    spec_dot, _, args_dot, state_dot = tangents
    if jtu.tree_leaves((spec_dot.system, spec_dot.section)):
        raise ArgumentError(
            f"{type(spec.system).__name__} or {type(spec.section).__name__} holds what is "
            "differentiated: it must be among args, whose derivatives are carried."
        )
    args_leaves = jtu.tree_leaves(args)
    column = jnp.stack(_dense(state_dot, state))[:, None]
    seeds = _dense(args_dot, args)
    relative = [d / jnp.where(v == 0.0, 1.0, v) for d, v in zip(seeds, args_leaves, strict=True)]
    inverse = jnp.stack(jtu.tree_leaves(units_of(args, state).inverse))
    floor = STATE_FLOOR * jnp.max(jnp.abs(column[:, 0] * inverse))
    if relative:
        floor = floor + PARAMETER_FLOOR * jnp.max(jnp.abs(jnp.stack(relative)))
    seeded = Seeded(
        args,
        jnp.stack(seeds)[:, None] if seeds else jnp.zeros((0, 1)),
        floor[None],
        tuple(range(len(seeds))),
    )
    found = solve_to_section(
        spec.watch(args, state, peak=False),
        spec.solver,
        Tangents(state, column),
        seeded,
        precision=precision,
        max_time=spec.max_time,
        max_solver_steps=spec.max_solver_steps,
    )
    structure = jtu.tree_structure(state)
    arrived_row, time_row = jtu.tree_map(
        lambda row: jnp.where(found.undetermined, jnp.nan, row),
        (found.y.columns[:, 0], found.time_columns[0]),
    )
    arrived = jtu.tree_unflatten(structure, list(arrived_row))

    def reset_map(args: PyTree, y: PyTree) -> PyTree:
        return reset_on_arrival(spec, args, y, found.time, found.code)[0]

    _, end_dot = jax.jvp(reset_map, (args, found.y.state), (full_tangents(args_dot, args), arrived))
    end_dot, time_dot = eqxi.nondifferentiable_backward((end_dot, time_row), msg=NO_REVERSE)
    # The values by themselves: they must not depend on what they are differentiated along.
    values = forward_by_xla(spec, precision, args, state)
    return values, (end_dot, time_dot, None)


def reverse_by_xla(
    spec: ReturnMapSpec, precision: Precision, args: PyTree, state: PyTree
) -> tuple[PyTree, Scalar, Scalar]:
    inverse = jnp.stack(jtu.tree_leaves(units_of(args, state).inverse))
    count = len(inverse)
    start = Tangents(state, jnp.eye(count))
    seeded = Seeded(args, jnp.zeros((0, count)), STATE_FLOOR * inverse, ())
    found = solve_to_section(
        spec.watch(args, state, peak=False),
        spec.solver,
        start,
        seeded,
        precision=precision,
        max_time=spec.max_time,
        max_solver_steps=spec.max_solver_steps,
        columns_only_choose_steps=True,
    )
    known = (found.y.state, found.time)
    y, time = _without_derivatives(found.undetermined, known, (args, state))
    return reset_on_arrival(spec, args, y, time, found.code)


@jax.custom_jvp
def _without_derivatives(undetermined: Scalar, values: PyTree, given: PyTree) -> PyTree:
    """The values, whose derivatives are NaN where `undetermined`: by all that was `given`."""
    del undetermined, given
    return values


@_without_derivatives.defjvp
def _without_derivatives_jvp(
    primals: tuple[Scalar, PyTree, PyTree], tangents: tuple[Scalar, PyTree, PyTree]
) -> tuple[PyTree, PyTree]:
    undetermined, values, _ = primals
    _, dots, given = tangents
    # Also by what the values do not depend on here, but may on the other side.
    nothing = jnp.where(undetermined, jnp.nan, 0.0)
    moved = sum((dot * nothing for dot in jtu.tree_leaves(given)), jnp.zeros(()))
    return values, jtu.tree_map(lambda dot: dot + moved, dots)


def reset_on_arrival(
    spec: ReturnMapSpec, args: PyTree, state: PyTree, time: Scalar, code: Scalar
) -> tuple[PyTree, Scalar, Scalar]:
    return select(code == 0, spec.system.reset_map(args, state), state), time, code


def _dense(tangents: PyTree, like: PyTree) -> list[Scalar]:
    """Tangents of every leaf, zeros where JAX left them out."""
    return jtu.tree_leaves(full_tangents(tangents, like))


def full_tangents(tangents: PyTree, like: PyTree) -> PyTree:
    def full(leaf: Scalar | None, dot: Scalar | None) -> Scalar | None:
        # A part that there is not, as bristles may be, has no tangent either.
        return jnp.zeros_like(leaf) if dot is None and leaf is not None else dot

    return jtu.tree_map(full, like, tangents, is_leaf=lambda leaf: leaf is None)

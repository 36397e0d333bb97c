"""Tangents: a state together with its derivatives in chosen directions."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar


class Tangents(NamedTuple):
    """A state and its derivatives in n directions.

    Attributes:
        state: pytree of scalars, c in all.
        columns: derivatives of its leaves, in their order, shape (c, n).
    """

    state: PyTree
    columns: Scalar


class Seeded(eqx.Module):
    """The arguments of a vector field and the directions in which they are differentiated.

    Attributes:
        args: pytree of scalars.
        seeds: derivatives of the active leaves in each direction, shape (p, n).
        floors: size below which a column's error is measured absolutely, shape (n,).
        active: positions of the p leaves of `args` that any direction moves.
    """

    args: PyTree
    seeds: Scalar
    floors: Scalar
    active: tuple[int, ...] = eqx.field(static=True)


def active_leaves(args: Seeded) -> list[Scalar]:
    """The leaves that any direction moves."""
    leaves = jtu.tree_leaves(args.args)
    return [leaves[i] for i in args.active]


def with_active(args: Seeded, values: Sequence[Scalar]) -> PyTree:
    """The arguments with their active leaves replaced."""
    leaves, structure = jtu.tree_flatten(args.args)
    for i, value in zip(args.active, values, strict=True):
        leaves[i] = value
    return jtu.tree_unflatten(structure, leaves)


def along_columns(
    function: Callable[[PyTree, PyTree], PyTree], y: Tangents, args: Seeded
) -> tuple[PyTree, PyTree]:
    """`function(state, args)` and its derivatives along the columns, leaves of shape (n, …)."""
    state, structure = jtu.tree_flatten(y.state)

    def of_leaves(state: list[Scalar], parameters: list[Scalar]) -> PyTree:
        return function(jtu.tree_unflatten(structure, state), with_active(args, parameters))

    def along(column: Scalar, seed: Scalar) -> PyTree:
        tangents = (list(column), list(seed))
        return jax.jvp(of_leaves, (state, active_leaves(args)), tangents)

    return jax.vmap(along, in_axes=-1, out_axes=(None, 0))(y.columns, args.seeds)


def along_columns_in_turn(
    function: Callable[[PyTree, PyTree], PyTree], y: Tangents, args: Seeded
) -> tuple[PyTree, PyTree]:
    """`along_columns`, one column after the other."""
    state, structure = jtu.tree_flatten(y.state)

    def of_leaves(state: list[Scalar], parameters: list[Scalar]) -> PyTree:
        return function(jtu.tree_unflatten(structure, state), with_active(args, parameters))

    def along(each: tuple[Scalar, Scalar]) -> PyTree:
        tangents = tuple([part[i] for i in range(part.shape[0])] for part in each)
        return jax.jvp(of_leaves, (state, active_leaves(args)), tangents)[1]

    found = jax.lax.map(along, (y.columns.T, args.seeds.T))
    return of_leaves(state, active_leaves(args)), found


def as_columns(tangents: PyTree) -> Scalar:
    """Derivatives with leaves of shape (n,) as one matrix of shape (c, n)."""
    return jnp.stack(jtu.tree_leaves(tangents))


def plain_state(y: PyTree) -> PyTree:
    """The state without its columns."""
    return y.state if isinstance(y, Tangents) else y


def plain_args(args: PyTree) -> PyTree:
    """The arguments without their seeds."""
    return args.args if isinstance(args, Seeded) else args

"""Reset of a state at a switch or on arrival, as by an impact, and what becomes of its columns."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.variational._tangents import (
    Seeded,
    Tangents,
    Watch,
    active_leaves,
    along_columns_in_turn,
    as_columns,
    with_active,
)


def behind_reset(
    watch: Watch,
    met: Scalar,
    past: Scalar,
    state: PyTree,
    columns: list[Scalar],
    args: Seeded,
    sizes: Scalar,
) -> tuple[PyTree, list[Scalar]]:
    """The state behind a switch that resets it, and its columns there.

    It is that on the switch: the little time past it is taken back. Columns are those where all
    motions meet the switch, so that the reset's own derivative is all that changes them.

    Args:
        watch: the field, and the reset of (args, state).
        met: whether the switch was met (boolean); else nothing changes.
        past: how long before [s]; so short that the state moves along its rates.
        state: just past the switch.
        columns: of the directions of the state, then of those of parameters, shapes (n, c).
        args: the arguments and their active leaves.
        sizes: by how much each of the last columns moves its parameter.
    """
    reset, structure, q = watch.reset, jtu.tree_structure(state), active_leaves(args)
    assert reset is not None

    def behind(leaves: list[Scalar], q: list[Scalar]) -> list[Scalar]:
        return jtu.tree_leaves(reset(with_active(args, q), jtu.tree_unflatten(structure, leaves)))

    def after() -> tuple[PyTree, list[Scalar]]:
        rates = watch.field(jnp.zeros_like(past), state, args.args)
        leaves = jtu.tree_leaves(jtu.tree_map(lambda leaf, rate: leaf - past * rate, state, rates))

        def along(each: tuple[Scalar, Scalar]) -> Scalar:
            return jnp.stack(jax.jvp(behind, (leaves, q), tuple(map(list, each)))[1])

        seeds = jnp.zeros((len(columns[0]), len(q))), jnp.diag(sizes)
        pairs = zip(columns, seeds, strict=True)
        moved = [jax.lax.map(along, pair) if len(pair[0]) else pair[0] for pair in pairs]
        return jtu.tree_unflatten(structure, behind(leaves, q)), moved

    found: tuple[PyTree, list[Scalar]] = jax.lax.cond(met, after, lambda: (state, columns))
    return found


def behind_arrival(watch: Watch, y: Tangents, args: Seeded) -> Tangents:
    """A state on the section and its columns there, as the watch's `arrival` makes them."""
    arrival = watch.arrival
    if arrival is None:
        return y
    state, moved = along_columns_in_turn(lambda s, a: arrival(a, s), y, args)
    return Tangents(state, as_columns(moved))

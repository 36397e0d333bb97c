"""Reset of a state at a switch, as by an impact, and what becomes of its columns."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.variational._tangents import Seeded, active_leaves, with_active


def behind_reset(
    reset: Callable[[PyTree, PyTree], PyTree],
    met: Scalar,
    state: PyTree,
    columns: list[Scalar],
    args: Seeded,
    sizes: Scalar,
) -> tuple[PyTree, list[Scalar]]:
    """The state behind a switch that resets it, and its columns there.

    Columns are those where all motions meet the switch, so that the reset's own derivative is all
    that changes them.

    Args:
        reset: of (args, state).
        met: whether the switch was met (boolean); else nothing changes.
        state: just past the switch.
        columns: of the directions of the state, then of those of parameters, shapes (n, c).
        args: the arguments and their active leaves.
        sizes: by how much each of the last columns moves its parameter.
    """
    leaves, structure = jtu.tree_flatten(state)
    q = active_leaves(args)

    def behind(leaves: list[Scalar], q: list[Scalar]) -> list[Scalar]:
        return jtu.tree_leaves(reset(with_active(args, q), jtu.tree_unflatten(structure, leaves)))

    def after() -> tuple[PyTree, list[Scalar]]:
        def along(each: tuple[Scalar, Scalar]) -> Scalar:
            return jnp.stack(jax.jvp(behind, (leaves, q), tuple(map(list, each)))[1])

        seeds = jnp.zeros((len(columns[0]), len(q))), jnp.diag(sizes)
        pairs = zip(columns, seeds, strict=True)
        moved = [jax.lax.map(along, pair) if len(pair[0]) else pair[0] for pair in pairs]
        return jtu.tree_unflatten(structure, behind(leaves, q)), moved

    found: tuple[PyTree, list[Scalar]] = jax.lax.cond(met, after, lambda: (state, columns))
    return found

"""Second derivatives of the return map at a periodic orbit."""

from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._curvature import Bent, along_path, bend
from jaxbiped.gait._turn import Turn, Turning, recurring_places
from jaxbiped.solve._columns import Seeded, active_leaves, with_active
from jaxbiped.solve._passage import arrival_at, taken_back


def second_turn(
    turning: Turning,
    args: Seeded,
    like: PyTree,
    last: Turn,
    turned: Scalar,
    tangents: Scalar,
    turned_seeds: Scalar,
    tangent_seeds: Scalar,
) -> Scalar:
    """Second derivatives of one turn along two sets of directions.

    Args:
        turning: how the turn was made.
        args: parameters.
        like: a state, for its structure.
        last: the turn, with its nodes.
        turned: v directions of the m recurring components, shape (m, v).
        tangents: q others, shape (m, q).
        turned_seeds, tangent_seeds: the same of the p active parameters.

    Returns:
        Shape (m + 1 + d, q, v): of the recurring components on the section, the period, and the
        advances.
    """
    leaves, structure = jtu.tree_flatten(like)
    c, count = len(leaves), turned.shape[1]
    places = jnp.asarray(recurring_places(turning.system, like))
    drifting = jnp.asarray(turning.system.drifting, dtype=int)
    seeds = jnp.concatenate([turned_seeds, tangent_seeds], axis=1)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(args)])
    watch = turning.watch(args.args, like)

    def parts(z: Scalar) -> tuple[PyTree, PyTree]:
        return structure.unflatten(list(z[:c])), with_active(args, list(z[c:]))

    def vector(y: PyTree) -> Scalar:
        return jnp.stack(jtu.tree_leaves(y))

    def rates(z: Scalar) -> Scalar:
        state, scene = parts(z)
        return vector(turning.system.vector_field(jnp.zeros(()), state, scene))

    def surfaces(z: Scalar) -> Any:
        state, scene = parts(z)
        return turning.system.switches(scene, state)

    def renewed(z: Scalar, past: Scalar) -> Scalar:
        state, scene = parts(z)
        return vector(turning.system.renew(scene, taken_back(watch, state, scene, past)))

    def arrived(z: Scalar) -> Scalar:
        state, scene = parts(z)
        section_state, past = arrival_at(watch, state, scene)
        end = vector(turning.system.renew(scene, section_state))
        return jnp.concatenate([end[places], -past[None], end[drifting]])

    first = jnp.zeros((c, seeds.shape[1])).at[places].set(jnp.concatenate([turned, tangents], 1))
    bent = Bent(first, jnp.zeros((c, tangents.shape[1], count)))
    times, states = last.nodes
    for k in range(turning.steps):
        nodes = jnp.stack([leaf[k] for leaf in jtu.tree_leaves(states)], axis=-1)
        bent = along_path(rates, surfaces, times[k], nodes, parameters, bent, seeds, count)
        final = nodes[jnp.sum(jnp.isfinite(times[k])) - 1]
        z = jnp.concatenate([final, parameters])
        if k + 1 < turning.steps:
            _, past = arrival_at(watch, *parts(z))
            past = jax.lax.stop_gradient(past)
            _, bent = bend(lambda z, past=past: renewed(z, past), z, bent, seeds, count)
    _, end = bend(arrived, z, bent, seeds, count)
    return end.second

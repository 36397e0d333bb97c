"""Second derivatives of the return map at a periodic orbit."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._bent import Bent, renewed
from jaxbiped.gait._bent_solve import along_nodes
from jaxbiped.gait._curvature import along_path
from jaxbiped.gait._flow import Flow
from jaxbiped.gait._turn import Turn, Turning, recurring_places
from jaxbiped.solve._columns import Seeded, active_leaves


def second_turn(
    turning: Turning,
    args: Seeded,
    like: PyTree,
    last: Turn,
    turned: Scalar,
    tangents: Scalar,
    sizes: Scalar,
) -> Scalar:
    """Second derivatives of one turn along two sets of directions.

    Args:
        turning: how the turn was made.
        args: parameters.
        like: a state, for its structure.
        last: the turn, with its nodes.
        turned: v directions of the m recurring components, which move no parameter; (m, v).
        tangents: p others, each of which moves one active parameter, shape (m, p).
        sizes: by how much, shape (p,).

    Returns:
        Shape (m + 1 + d, p, v): of the recurring components on the section, the period, and the
        advances.
    """
    c, count = len(jtu.tree_leaves(like)), turned.shape[1]
    places = jnp.asarray(recurring_places(turning.system, like))
    drifting = jnp.asarray(turning.system.drifting, dtype=int)
    seeds = jnp.concatenate([jnp.zeros((len(sizes), count)), jnp.diag(sizes)], axis=1)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(args)])
    flow = _flow(turning, args, like)
    first = jnp.zeros((c, seeds.shape[1])).at[places].set(jnp.concatenate([turned, tangents], 1))
    bent = Bent(first, jnp.zeros((c, tangents.shape[1], count)))
    assert last.nodes is not None
    for k in range(turning.steps):
        nodes = jax.tree.map(lambda leaf, k=k: leaf[k], last.nodes)
        final = k + 1 == turning.steps
        if turning.engine == "lanes":
            bent, period = along_nodes(flow, nodes, bent, sizes, final=final)
            continue
        # The motion begins and ends before its section: that may be a switch, as touchdown is.
        start, end = (flow.earlier(row, parameters) for row in (nodes.start, nodes.arrival))
        ends = nodes.ends.at[nodes.steps - 1].set(end)
        rows = jnp.concatenate([start[None], ends])
        times = jnp.where(jnp.arange(len(rows)) <= nodes.steps, rows[:, 0], jnp.inf)
        bent = along_path(flow, times, rows[:, 1:], parameters, bent, seeds, count)
        z = jnp.concatenate([end[1:], parameters])
        bent, period = renewed(flow, z, bent, seeds, count, final=final)
    second = bent.second
    parted = [second[places], period[None], second[drifting]]
    return jnp.concatenate(parted)


def _flow(turning: Turning, args: Seeded, like: PyTree) -> Flow:
    watch = turning.watch(args.args, like)
    assert watch.section is not None
    field = turning.system.vector_field
    return Flow(turning.system, watch.section, field, args, jtu.tree_structure(like))

"""Second derivatives of the return map at a periodic orbit."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._bent import Bent, renewed
from jaxbiped.gait._bent_solve import along_nodes, prepare_along_nodes
from jaxbiped.gait._curvature import along_path
from jaxbiped.gait._flow import Flow
from jaxbiped.gait._radau import stacked
from jaxbiped.gait._turn import Turn, Turning, recurring_places
from jaxbiped.solve._columns import Seeded, active_leaves
from jaxbiped.solve._landing import MARGIN


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
        # The last step ends on the section, which may be a switch, as touchdown is: the motion
        # begins and ends before it.
        start, end = (_earlier(flow, row, parameters) for row in (nodes.start, nodes.arrival))
        final = k + 1 == turning.steps
        if turning.engine == "lanes":
            nodes = nodes._replace(start=start, arrival=end)
            bent, period = along_nodes(flow, nodes, bent, sizes, final=final)
            continue
        ends = nodes.ends.at[nodes.steps - 1].set(end)
        rows = jnp.concatenate([start[None], ends])
        times = jnp.where(jnp.arange(len(rows)) <= nodes.steps, rows[:, 0], jnp.inf)
        bent = along_path(flow, times, rows[:, 1:], parameters, bent, seeds, count)
        z = jnp.concatenate([end[1:], parameters])
        bent, period = renewed(flow, z, bent, seeds, count, final=final)
    second = bent.second
    parted = [second[places], period[None], second[drifting]]
    return jnp.concatenate(parted)


def prepare_second_turn(turning: Turning, args: Seeded, like: PyTree, count: int) -> None:
    """Begins to compile what `count` of `second_turn` at once need by lanes, before any turn."""
    flow = _flow(turning, args, like)
    for final in {turning.steps == 1, True}:
        prepare_along_nodes(flow, count, final=final)


def _flow(turning: Turning, args: Seeded, like: PyTree) -> Flow:
    watch = turning.watch(args.args, like)
    assert watch.section is not None
    field = turning.system.vector_field
    return Flow(turning.system, watch.section, field, args, jtu.tree_structure(like))


def _earlier(flow: Flow, row: Scalar, parameters: Scalar) -> Scalar:
    """A time and state as little earlier as tells a switch's sides apart."""
    velocity = stacked(flow)(jnp.concatenate([row[1:], parameters]))
    return row - MARGIN * jnp.concatenate([jnp.ones(1), velocity])

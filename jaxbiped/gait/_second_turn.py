"""Second derivatives of the return map at a periodic orbit."""

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._bent import Bent, renewed
from jaxbiped.gait._bent_solve import along_nodes
from jaxbiped.gait._curvature import along_path
from jaxbiped.gait._flow import Flow
from jaxbiped.gait._radau import velocities
from jaxbiped.gait._turn import Turn, Turning, recurring_places
from jaxbiped.solve._columns import Seeded, active_leaves
from jaxbiped.solve._landing import MARGIN
from jaxbiped.solve._passage import arrival_at


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
    leaves, structure = jtu.tree_flatten(like)
    c, count = len(leaves), turned.shape[1]
    places = jnp.asarray(recurring_places(turning.system, like))
    drifting = jnp.asarray(turning.system.drifting, dtype=int)
    seeds = jnp.concatenate([jnp.zeros((len(sizes), count)), jnp.diag(sizes)], axis=1)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(args)])
    watch = turning.watch(args.args, like)
    assert watch.section is not None
    flow = Flow(turning.system, watch.section, turning.system.vector_field, args, structure)
    first = jnp.zeros((c, seeds.shape[1])).at[places].set(jnp.concatenate([turned, tangents], 1))
    bent = Bent(first, jnp.zeros((c, tangents.shape[1], count)))
    times, states = last.nodes
    for k in range(turning.steps):
        nodes = jnp.stack([leaf[k] for leaf in jtu.tree_leaves(states)], axis=-1)
        end = jnp.sum(jnp.isfinite(times[k])) - 1
        # The last step ends on the section, not just past it.
        arrived, past = arrival_at(
            watch, jtu.tree_unflatten(structure, list(nodes[end])), args.args
        )
        clock = times[k].at[end].add(-past)
        nodes = nodes.at[end].set(jnp.stack(jtu.tree_leaves(arrived)))
        # A section may be a switch, as touchdown is: the motion begins and ends before it.
        clock, nodes = _earlier(flow, clock, nodes, jnp.stack([0, end]), parameters)
        final = k + 1 == turning.steps
        if turning.engine == "lanes":
            bent, period = along_nodes(flow, clock, nodes, end, bent, sizes, final=final)
            continue
        bent = along_path(flow, clock, nodes, parameters, bent, seeds, count)
        z = jnp.concatenate([nodes[end], parameters])
        bent, period = renewed(flow, z, bent, seeds, count, final=final)
    second = bent.second
    parted = [second[places], period[None], second[drifting]]
    return jnp.concatenate(parted)


def _earlier(
    flow: Flow,
    clock: Scalar,
    nodes: Scalar,
    places: Scalar,
    parameters: Scalar,
) -> tuple[Scalar, Scalar]:
    """Times and states, some of them as little earlier as tells a switch's sides apart."""
    back = -MARGIN * velocities(flow, nodes[places], parameters)
    return clock.at[places].add(-MARGIN), nodes.at[places].add(back)

"""Second derivatives of the return map at a periodic orbit."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._poincare_map import Turn, Turning, recurring_places
from jaxbiped.variational._adjoint_solve import carried, pulled_back
from jaxbiped.variational._adjoint_step import Adjoints
from jaxbiped.variational._curvature import along_path
from jaxbiped.variational._flow import Flow
from jaxbiped.variational._jets import Bent, renewed
from jaxbiped.variational._tangents import Seeded, active_leaves


def second_turn(
    turning: Turning,
    args: Seeded,
    like: PyTree,
    last: Turn,
    turned: Scalar,
    weights: Scalar,
    tangents: Scalar,
    sizes: Scalar,
) -> Scalar:
    """Second derivatives of the return map along two sets of directions, as weighted sums.

    Args:
        turning: how the turn was made.
        args: parameters.
        like: a state, for its structure.
        last: the turn, with its nodes.
        turned: v directions of the m recurring components, which move no parameter; (v, m).
        weights: of the recurring components of each one's second derivatives, (v, m).
        tangents: p other directions, each of which moves one active parameter, shape (m, p).
        sizes: by how much, shape (p,).

    Returns:
        For each of the p the sum over components and the v, shape (p,).
    """
    flow = _flow(turning, args, like)
    places = jnp.asarray(recurring_places(turning.system, like))
    if turning.engine == "lanes":
        adjoints = _pulled_back(turning, flow, places, last, turned, weights)
        return adjoints.family[places] @ tangents + adjoints.parameters * sizes
    second = _every(turning, flow, places, last, turned, tangents, sizes)
    return jnp.einsum("vm,mpv->p", weights, second[places])


def _pulled_back(
    turning: Turning, flow: Flow, places: Scalar, last: Turn, turned: Scalar, weights: Scalar
) -> Adjoints:
    """Derivatives of the weighted sum by what is at the start of the turn."""
    c, p = flow.structure.num_leaves, len(flow.args.active)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(flow.args)])
    along, known = jnp.zeros((len(turned), c)).at[:, places].set(turned), []
    for k in range(turning.steps):
        nodes = jax.tree.map(lambda leaf, k=k: leaf[k], last.nodes)
        arrived, steps = carried(flow, nodes, along)
        known.append((nodes, arrived, steps))
        if k + 1 < turning.steps:
            before = flow.earlier(nodes.arrival, parameters)[1:]
            along = _behind(flow, before, parameters, arrived.turned)
    second = jnp.zeros((len(weights), c)).at[:, places].set(weights)
    adjoints = Adjoints(second, jnp.zeros(c), jnp.zeros(p))
    for k, (nodes, arrived, steps) in reversed(list(enumerate(known))):
        final = k + 1 == turning.steps
        adjoints = pulled_back(flow, nodes, arrived, steps, adjoints, final=final)
    return adjoints


def _behind(flow: Flow, state: Scalar, parameters: Scalar, turned: Scalar) -> Scalar:
    """Turned tangents (v, c) behind the renewal of an arrival at a fixed time."""

    def renewed(state: Scalar) -> Scalar:
        return flow.renewed(jnp.concatenate([state, parameters]))

    return jax.vmap(lambda tangent: jax.jvp(renewed, (state,), (tangent,))[1])(turned)


def _every(
    turning: Turning,
    flow: Flow,
    places: Scalar,
    last: Turn,
    turned: Scalar,
    tangents: Scalar,
    sizes: Scalar,
) -> Scalar:
    """All second derivatives of the components on the section, shape (c, p, v)."""
    c, count = flow.structure.num_leaves, len(turned)
    seeds = jnp.concatenate([jnp.zeros((len(sizes), count)), jnp.diag(sizes)], axis=1)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(flow.args)])
    along = jnp.concatenate([turned.T, tangents], axis=1)
    first = jnp.zeros((c, seeds.shape[1])).at[places].set(along)
    bent = Bent(first, jnp.zeros((c, len(sizes), count)))
    assert last.nodes is not None
    for k in range(turning.steps):
        nodes = jax.tree.map(lambda leaf, k=k: leaf[k], last.nodes)
        # The motion begins and ends before its section: that may be a switch, as touchdown is.
        start, end = (flow.earlier(row, parameters) for row in (nodes.start, nodes.arrival))
        ends = nodes.ends.at[nodes.steps - 1].set(end)
        rows = jnp.concatenate([start[None], ends])
        times = jnp.where(jnp.arange(len(rows)) <= nodes.steps, rows[:, 0], jnp.inf)
        bent = along_path(flow, times, rows[:, 1:], parameters, bent, seeds, count)
        z = jnp.concatenate([end[1:], parameters])
        bent = renewed(flow, z, bent, seeds, count, final=k + 1 == turning.steps)
    return bent.second


def _flow(turning: Turning, args: Seeded, like: PyTree) -> Flow:
    watch = turning.watch(args.args, like)
    assert watch.section is not None
    field = turning.system.vector_field
    return Flow(turning.system, watch.section, field, args, jtu.tree_structure(like))

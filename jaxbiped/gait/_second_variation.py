"""Second variation of the return map at a periodic orbit.

The spectral radius is a function of the return map's Jacobian, so its sensitivities are second
derivatives of the map.
"""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._poincare_map import LinearisedReturn, recurring_indices
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.variational._adjoint_solve import carry_tangents, pull_back
from jaxbiped.variational._adjoint_step import Adjoints
from jaxbiped.variational._curvature import jet_along_path
from jaxbiped.variational._flow import Flow
from jaxbiped.variational._jets import Jet, reset_jet
from jaxbiped.variational._tangents import Seeded, active_leaves


def second_variation(
    spec: ReturnMapSpec,
    args: Seeded,
    like: PyTree,
    last: LinearisedReturn,
    leading: Scalar,
    weights: Scalar,
    tangents: Scalar,
    sizes: Scalar,
) -> Scalar:
    """Second derivatives of the return map along two sets of directions, as weighted sums.

    Args:
        spec: of the return map.
        args: parameters.
        like: a state, for its structure.
        last: the return, with its nodes.
        leading: v directions of the m recurring components, those of the leading eigenpair, which
            move no parameter; (v, m).
        weights: of the recurring components of each one's second derivatives, (v, m), or of all
            components, (v, c).
        tangents: p other directions, each of which moves one active parameter, shape (m, p).
        sizes: by how much, shape (p,).

    Returns:
        For each of the p the sum over components and the v, shape (p,).
    """
    flow = _flow(spec, args, like)
    places = jnp.asarray(recurring_indices(spec.system, like))
    c = flow.structure.num_leaves
    if weights.shape[1] != c:
        weights = jnp.zeros((len(weights), c)).at[:, places].set(weights)
    if spec.engine == "lanes":
        adjoints = _pull_back(spec, flow, places, last, leading, weights)
        return adjoints.family[places] @ tangents + adjoints.parameters * sizes
    second = _all_second_derivatives(spec, flow, places, last, leading, tangents, sizes)
    return jnp.einsum("vc,cpv->p", weights, second)


def _pull_back(
    spec: ReturnMapSpec,
    flow: Flow,
    places: Scalar,
    last: LinearisedReturn,
    leading: Scalar,
    weights: Scalar,
) -> Adjoints:
    """Derivatives of the weighted sum with respect to what the cycle starts from."""
    c, p = flow.structure.num_leaves, len(flow.args.active)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(flow.args)])
    along, carried = jnp.zeros((len(leading), c)).at[:, places].set(leading), []
    for k in range(spec.steps):
        nodes = jax.tree.map(lambda leaf, k=k: leaf[k], last.nodes)
        arrived, steps = carry_tangents(flow, nodes, along)
        carried.append((nodes, arrived, steps))
        if k + 1 < spec.steps:
            before = flow.earlier(nodes.arrival, parameters)[1:]
            along = _after_arrival(flow, before, parameters, arrived.leading)
    adjoints = Adjoints(weights, jnp.zeros(c), jnp.zeros(p))
    for k, (nodes, arrived, steps) in reversed(list(enumerate(carried))):
        final = k + 1 == spec.steps
        adjoints = pull_back(flow, nodes, arrived, steps, adjoints, final=final)
    return adjoints


def _after_arrival(flow: Flow, state: Scalar, parameters: Scalar, leading: Scalar) -> Scalar:
    """Leading tangents (v, c) behind the reset of an arrival at a fixed time."""

    def reset(state: Scalar) -> Scalar:
        return flow.reset(jnp.concatenate([state, parameters]))

    return jax.vmap(lambda tangent: jax.jvp(reset, (state,), (tangent,))[1])(leading)


def _all_second_derivatives(
    spec: ReturnMapSpec,
    flow: Flow,
    places: Scalar,
    last: LinearisedReturn,
    leading: Scalar,
    tangents: Scalar,
    sizes: Scalar,
) -> Scalar:
    """All second derivatives of the components on the section, shape (c, p, v)."""
    c, count = flow.structure.num_leaves, len(leading)
    seeds = jnp.concatenate([jnp.zeros((len(sizes), count)), jnp.diag(sizes)], axis=1)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(flow.args)])
    along = jnp.concatenate([leading.T, tangents], axis=1)
    first = jnp.zeros((c, seeds.shape[1])).at[places].set(along)
    jet = Jet(first, jnp.zeros((c, len(sizes), count)))
    assert last.nodes is not None
    for k in range(spec.steps):
        nodes = jax.tree.map(lambda leaf, k=k: leaf[k], last.nodes)
        # The motion begins and ends before its section: that may be a switch, as touchdown is.
        start, end = (flow.earlier(row, parameters) for row in (nodes.start, nodes.arrival))
        ends = nodes.ends.at[nodes.steps - 1].set(end)
        rows = jnp.concatenate([start[None], ends])
        times = jnp.where(jnp.arange(len(rows)) <= nodes.steps, rows[:, 0], jnp.inf)
        jet = jet_along_path(flow, times, rows[:, 1:], parameters, jet, seeds, count)
        z = jnp.concatenate([end[1:], parameters])
        jet = reset_jet(flow, z, jet, seeds, count, final=k + 1 == spec.steps)
    return jet.second


def _flow(spec: ReturnMapSpec, args: Seeded, like: PyTree) -> Flow:
    watch = spec.watch(args.args, like)
    assert watch.section is not None
    field = spec.system.vector_field
    return Flow(spec.system, watch.section, field, args, jtu.tree_structure(like))

"""Second variation of the return map at a periodic orbit.

The spectral radius is a function of the return map's Jacobian, so its sensitivities are second
derivatives of the map.
"""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.compiler import LANES, XLA
from jaxbiped.gait._poincare_map import LinearisedReturn, recurring_indices
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.variational._adjoint_solve import Adjoints, carry_tangents, pull_back
from jaxbiped.variational._flow import Flow, tangent_on_section
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

    An adjoint: the leading tangents go along the cycle, the sum's derivatives with respect to what
    it starts from come back, whatever the number of parameters.

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
    engine = LANES if spec.engine == "lanes" else XLA
    watch = spec.watch(args.args, like)
    assert watch.section is not None
    field = spec.system.vector_field
    flow = Flow(spec.system, watch.section, field, args, jtu.tree_structure(like))
    places = jnp.asarray(recurring_indices(spec.system, like))
    c, p = flow.structure.num_leaves, len(args.active)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(args)])
    along, carried = jnp.zeros((len(leading), c)).at[:, places].set(leading), []
    for k in range(spec.steps):
        nodes = jax.tree.map(lambda leaf, k=k: leaf[k], last.nodes)
        arrived, steps = carry_tangents(engine, flow, nodes, along)
        carried.append((nodes, arrived, steps))
        if k + 1 < spec.steps:
            along = _behind_arrival(flow, nodes.arrival, parameters, arrived.leading)
    if weights.shape[1] != c:
        weights = jnp.zeros((len(weights), c)).at[:, places].set(weights)
    adjoints = Adjoints(weights, jnp.zeros(c), jnp.zeros(p))
    for nodes, arrived, steps in reversed(carried):
        adjoints = pull_back(engine, flow, nodes, arrived, steps, adjoints)
    return adjoints.family[places] @ tangents + adjoints.parameters * sizes


def _behind_arrival(flow: Flow, arrival: Scalar, parameters: Scalar, leading: Scalar) -> Scalar:
    """Leading tangents (v, c) on the section, behind the reset: maps from arrival to arrival are
    composed, so that the reset need be no symmetry of the motion."""
    z = jnp.concatenate([flow.earlier(arrival, parameters)[1:], parameters])

    def behind(tangent: Scalar) -> Scalar:
        along = jnp.concatenate([tangent, jnp.zeros_like(parameters)])
        return jax.jvp(flow.reset, (z,), (tangent_on_section(flow, z, along),))[1]

    return jax.vmap(behind)(leading)

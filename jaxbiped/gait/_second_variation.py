"""Second variation of the return map at a periodic orbit.

The spectral radius is a function of the return map's Jacobian, so its sensitivities are second
derivatives of the map.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar
from jaxbiped.compiler import LANES, XLA
from jaxbiped.gait._poincare_map import (
    LinearisedReturn,
    linearised_return,
    recurring_indices,
    state_with,
)
from jaxbiped.gait._return_map_spec import ReturnMapSpec, has_switches
from jaxbiped.solve._accuracy import Precision
from jaxbiped.variational._adjoint_solve import Adjoints, carry_tangents, pull_back
from jaxbiped.variational._flow import Flow, tangent_on_section
from jaxbiped.variational._tangents import Seeded, active_leaves

_STEP = 0.2
"""Step of these differences, in units of the fifth root of the tolerance."""


class SecondVariation(NamedTuple):
    """Second derivatives along p directions, as weighted sums.

    Attributes:
        slopes: the sums, shape (p,).
        by_point: what they have by each of the m recurring components, shape (m,).
        by_parameter: what they have by each parameter itself, moved by its size, shape (p,).
        errors: of differences across a force that jumps or is steep, shape (p,); zero elsewhere.
    """

    slopes: Scalar
    by_point: Scalar
    by_parameter: Scalar
    errors: RealScalarLike = 0.0


def second_variation(
    spec: ReturnMapSpec,
    args: Seeded,
    like: PyTree,
    last: LinearisedReturn,
    leading: Scalar,
    weights: Scalar,
    tangents: Scalar,
    sizes: Scalar,
    precision: Precision,
) -> SecondVariation:
    """Second derivatives of the return map along two sets of directions, as weighted sums.

    An adjoint: the leading tangents go along the cycle, the sum's derivatives with respect to what
    it starts from come back, whatever the number of parameters. Where second derivatives are not
    followed, across a switch that resets the state or where the force jumps or is infinitely steep,
    differences of first ones, by lanes alone. NaN where they are not known.

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
        precision: of the return.

    Returns:
        For each of the p the sum over components and the v.
    """
    engine = LANES if spec.engine == "lanes" else XLA
    watch = spec.watch(args.args, like)
    assert watch.section is not None
    if has_switches(spec.system, args.args, like, "first_only"):
        if spec.engine == "xla":  # which would compile another solve, for minutes
            unknown = jnp.full(len(sizes), jnp.nan)
            return SecondVariation(unknown, jnp.zeros(len(tangents)), unknown)
        return _by_differences(spec, args, like, last, leading, weights, tangents, precision)
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
    by_point, by_parameter = adjoints.family[places], adjoints.parameters * sizes
    slopes = jnp.where(last.jumps > 0, jnp.nan, by_point @ tangents + by_parameter)
    return SecondVariation(slopes, by_point, by_parameter)


def _by_differences(
    spec: ReturnMapSpec,
    args: Seeded,
    like: PyTree,
    last: LinearisedReturn,
    leading: Scalar,
    weights: Scalar,
    tangents: Scalar,
    precision: Precision,
) -> SecondVariation:
    """The same from differences of Jacobians along the leading directions, of which there are few:
    second derivatives are symmetric.
    """
    m, c = len(tangents), weights.shape[1]
    pair, h = _jacobian_slopes(spec, args, like, last, leading, precision)
    both = jnp.einsum("vc,ovcn->on", weights, pair[:, :, -c:])
    by_point, by_parameter = both[0, :m], both[0, m:]
    slopes, rougher = both[:, :m] @ tangents + both[:, m:]
    errors: RealScalarLike = 0.0
    if not has_switches(spec.system, args.args, like, "resets"):
        # Between resets a motion is smooth; a force that jumps makes the Jacobians' errors rough.
        own = jnp.abs(jnp.concatenate([last.advance_rows, last.jacobian])[-c:])
        sizes = jnp.einsum("vc,cn,v->n", jnp.abs(weights), own, 1.0 / h)
        size = sizes[:m] @ jnp.abs(tangents) + sizes[m:]
        errors = jnp.abs(slopes - rougher) + precision.tangent_rtol * size
    return SecondVariation(slopes, by_point, by_parameter, errors)


def _jacobian_slopes(
    spec: ReturnMapSpec,
    args: Seeded,
    like: PyTree,
    last: LinearisedReturn,
    leading: Scalar,
    precision: Precision,
) -> tuple[Scalar, Scalar]:
    """Derivatives of the Jacobian's rows along v directions, of two orders, shape (2, v, c, n), and
    the steps of their differences, shape (v,).

    Central differences of order four, whose step balances their error and the solve's, and of two.
    """
    size = jnp.max(jnp.abs(leading), axis=1)
    h = _STEP * jnp.power(precision.rtol, 0.2) / jnp.maximum(1.0, size)

    def rows(along: Scalar, share: Scalar) -> Scalar:
        state = state_with(spec.system, like, last.recurring + share * along)
        # A real eigenvector has no imaginary part to go along.
        idle = ~jnp.any(along != 0.0)
        once = linearised_return(spec.with_more_steps(), args, state, precision, idle)
        found = jnp.concatenate([once.advance_rows, once.jacobian])
        return jnp.where(idle, 0.0, jnp.where(once.code != 0, jnp.nan, found))

    shares = h[:, None] * jnp.array([1.0, -1.0, 2.0, -2.0])
    each = jax.vmap(jax.vmap(rows, (None, 0)))(leading, shares)
    near, back, far, farther = jnp.moveaxis(each, 1, 0)
    pair = (8.0 * (near - back) - (far - farther)) / 12.0, (near - back) / 2.0
    return jnp.stack(pair) / h[:, None, None], h


def _behind_arrival(flow: Flow, arrival: Scalar, parameters: Scalar, leading: Scalar) -> Scalar:
    """Leading tangents (v, c) on the section, behind the reset: maps from arrival to arrival are
    composed, so that the reset need be no symmetry of the motion."""
    z = jnp.concatenate([flow.earlier(arrival, parameters)[1:], parameters])

    def behind(tangent: Scalar) -> Scalar:
        along = jnp.concatenate([tangent, jnp.zeros_like(parameters)])
        return jax.jvp(flow.reset, (z,), (tangent_on_section(flow, z, along),))[1]

    return jax.vmap(behind)(leading)

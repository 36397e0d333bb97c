"""Adjoint step of the second variation, backwards in time.

For two tangents V and Q of a motion its mixed second tangent C follows C' = J C + f''[V, Q]. Across
a switch g = 0, crossed at the rate ġ, the Jacobian J jumps, so its derivative holds a pulse that no
derivative taken through solver steps can see: C jumps by (J₊ − J₋) V (dg·Q)/ġ. A weighted sum of C
at the end of a step is a sum of what was before it: C there, and linearly the family's tangent Q
and the parameters, which enter the source and the jump. So the weights go backwards, two rows for C
and one for Q, however many families there are. All components are in order.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.variational._collocated_step import Linear, Rows
from jaxbiped.variational._first_variation import Step, without_flow


class Adjoints(NamedTuple):
    """Derivatives of a sum with respect to second tangents (v, c), a family's tangent (c,) and
    parameters (p,).
    """

    second: Scalar
    family: Scalar
    parameters: Scalar


def adjoint_step(
    rows: Rows, linear: Linear, step: Step, early: Scalar, after: Adjoints
) -> Adjoints:
    """Adjoints before a step, from those behind it; `early` as from `earlier_at`."""
    order, stages = rows.order, linear.stages
    c, d, count = len(order.every), order.direct, len(step.leading)
    nowhere = jnp.zeros(c)
    begun, lost = without_flow(step.leading, linear.velocity, step.fresh > 0.0)
    at_stages = stages.carried(begun)
    ends = [stages.pulled(jnp.stack([nowhere, nowhere, each])) for each in after.second]
    second = jnp.stack([start for start, _ in ends])
    weights = jnp.stack([forcing for _, forcing in ends], axis=1)
    tangents = order.restored(jnp.moveaxis(at_stages, 1, 0))
    curved = jax.lax.map(lambda each: rows.curved(*each), (linear.points, tangents, weights))
    # By how much earlier the switch is crossed, which times the jump.
    jumps = [(linear.jump @ at_stages[v, 2]) @ after.second[v, d:] for v in range(count)]
    soon = sum(jumps[1:], jumps[0])
    by_end = after.family + soon * order.sorted(early[:c])
    family, forcing = stages.pulled(curved[:, :c] + jnp.stack([nowhere, nowhere, by_end]))
    by_parameter = jnp.einsum("jk,jkp->p", forcing, linear.by_parameter)
    own = jnp.sum(curved[:, c:], axis=0) + soon * early[c:]
    without = Adjoints(second, family, after.parameters + by_parameter + own)
    return _with_flow(linear, step, lost, without)


def _with_flow(linear: Linear, step: Step, lost: Scalar, after: Adjoints) -> Adjoints:
    """Adjoints before parts of the flow are taken out of V and Q, and C changes with them.

    Where V loses σ f and Q loses τ f, C gains σ τ f' − σ Q' − τ V'. Of V that is `lost`.
    """
    order, velocity, gradient = linear.stages.order, linear.velocity, linear.at_start
    c, d = len(order.every), order.direct

    def rate_of(tangent: Scalar) -> Scalar:
        kept = gradient[:, :c] @ tangent
        return jnp.concatenate([tangent[d : 2 * d], kept]) if d else kept

    flow, rate, shift = rate_of(velocity), jnp.zeros(c), -(after.family @ velocity)
    for v in range(len(lost)):
        shift = shift + after.second[v] @ (lost[v] * flow - rate_of(step.leading[v]))
        rate = rate - lost[v] * after.second[v]
    pulled = rate[d:] @ gradient
    family = after.family + pulled[:c]
    if d:
        follows = [jnp.zeros(d), rate[:d], jnp.zeros(c - 2 * d)]
        family = family + jnp.concatenate(follows)
    part = jnp.where(step.fresh > 0.0, 0.0, shift / (velocity @ velocity))
    return Adjoints(after.second, family + part * velocity, after.parameters + pulled[c:])

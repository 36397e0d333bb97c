"""Jets: first and second tangents together, through a function and onto a surface.

The second variation carries both through resets and onto sections.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.variational._flow import Flow
from jaxbiped.variational._radau_collocation import Rates, stack_rates


class Jet(NamedTuple):
    """Tangents of a motion and their mixed second tangents. c components, p parameters.

    Attributes:
        first: v tangents V and after them q tangents Q, shape (c, v + q).
        second: mixed tangents C, shape (c, q, v).
    """

    first: Scalar
    second: Scalar


def reset_jet(
    flow: Flow,
    z: Scalar,
    jet: Jet,
    seeds: Scalar,
    count: int,
    *,
    final: bool,
) -> Jet:
    """Tangents after an arrival at `z`.

    Of the `final` arrival tangents on the section; of one before it at a fixed time.
    """
    if final:
        jet = on_surface(flow, flow.section, z, jet, seeds, count)
    return push_jet(flow.reset, z, jet, seeds, count)


def on_surface(
    rates: Rates,
    surface: Callable[[Scalar], Scalar],
    z: Scalar,
    jet: Jet,
    seeds: Scalar,
    count: int,
) -> Jet:
    """Tangents at a fixed time made tangents on the surface g = 0 that `z` lies on.

    A tangent V moves the arrival by τ_V = −dg·V/ġ and becomes V + f τ_V. Differentiated once more,
    C becomes C + (J V) τ_Q + (J Q) τ_V + (J f) τ_V τ_Q + f τ_VQ, where τ_VQ keeps it
    on the surface.
    """
    c = jet.first.shape[0]
    seeded = jnp.concatenate([jet.first, seeds])
    field = stack_rates(rates)
    rate = field(z)
    flow = jnp.concatenate([rate, jnp.zeros(seeds.shape[0])])

    def directional_derivative(along: Scalar) -> Scalar:
        return jax.jvp(field, (z,), (along,))[1]

    gradient = jax.grad(surface)(z)
    slope = gradient @ flow
    times = -(gradient @ seeded) / slope
    on = seeded + flow[:, None] * times
    rates_along = jax.vmap(directional_derivative, in_axes=-1, out_axes=-1)(seeded)
    by_v, by_q = times[:count], times[count:]
    second = jet.second + jnp.einsum("cv,q->cqv", rates_along[:, :count], by_q)
    second = second + jnp.einsum("cq,v->cqv", rates_along[:, count:], by_v)
    second = second + jnp.einsum("c,q,v->cqv", directional_derivative(flow), by_q, by_v)
    curved = jnp.einsum("aq,ab,bv->qv", on[:, count:], jax.hessian(surface)(z), on[:, :count])
    both = -(curved + jnp.einsum("c,cqv->qv", gradient[:c], second)) / slope
    second = second + jnp.einsum("c,qv->cqv", rate, both)
    return Jet(on[:c], second)


def push_jet(
    function: Callable[[Scalar], Scalar], z: Scalar, jet: Jet, seeds: Scalar, count: int
) -> Jet:
    """Tangents of a function of components and parameters (c + p,), in place of theirs."""
    seeded = jnp.concatenate([jet.first, seeds])

    def slope(z: Scalar, along: Scalar) -> Scalar:
        return jax.jvp(function, (z,), (along,))[1]

    first = jax.vmap(lambda along: slope(z, along), in_axes=-1, out_axes=-1)(seeded)

    def mixed(along: Scalar, tangent: Scalar, second: Scalar) -> Scalar:
        idle = jnp.zeros(seeds.shape[0])
        change = jnp.concatenate([second, idle])
        return jax.jvp(slope, (z, along), (tangent, change))[1]

    by_tangent = jax.vmap(mixed, in_axes=(None, -1, -1), out_axes=-1)
    by_both = jax.vmap(by_tangent, in_axes=(-1, None, -1), out_axes=-1)
    return Jet(first, by_both(seeded[:, :count], seeded[:, count:], jet.second))

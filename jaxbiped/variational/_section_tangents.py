"""Tangents on a section: first and mixed second tangents that follow the arrival there."""

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.variational._flow import Flow


def on_section(
    flow: Flow, jacobian: Scalar, z: Scalar, v: Scalar, q: Scalar, second: Scalar
) -> tuple[Scalar, Scalar, Scalar]:
    """Tangents at a fixed time made tangents on the section g = 0 that `z` lies on.

    A tangent V moves the arrival by τ_V = −dg·V/ġ and becomes V + f τ_V. Differentiated once more,
    the mixed tangent C becomes C + (J V) τ_Q + (J Q) τ_V + (J f) τ_V τ_Q + f τ_VQ, where τ_VQ keeps
    it on the section.

    Args:
        flow: what moves.
        jacobian: J of its rates, shape (c, c + p).
        z: components and parameters, shape (c + p,), as `v` and `q`.
        v, q: the tangents.
        second: C, shape (c,).
    """
    c = len(second)
    rate = flow.velocity(z)
    velocity = jnp.concatenate([rate, jnp.zeros(len(z) - c)])
    gradient, curve = jax.jvp(jax.grad(flow.section), (z,), (v,))
    slope = gradient @ velocity
    by_v, by_q = -(gradient @ v) / slope, -(gradient @ q) / slope
    curve = curve + by_v * jax.jvp(jax.grad(flow.section), (z,), (velocity,))[1]
    second = second + (jacobian @ v) * by_q + (jacobian @ (q + velocity * by_q)) * by_v
    both = -(curve @ (q + velocity * by_q) + gradient[:c] @ second) / slope
    return v + velocity * by_v, q + velocity * by_q, second + rate * both


def tangent_on_section(flow: Flow, z: Scalar, v: Scalar) -> Scalar:
    """A first tangent at a fixed time made one on the section, as `on_section` does; (c + p,)."""
    rate = flow.velocity(z)
    velocity = jnp.concatenate([rate, jnp.zeros(len(z) - len(rate))])
    gradient = jax.grad(flow.section)(z)
    return v - velocity * (gradient @ v) / (gradient @ velocity)


def after_reset(
    flow: Flow, z: Scalar, v: Scalar, q: Scalar, second: Scalar
) -> tuple[Scalar, Scalar]:
    """Of `q` and the mixed tangent what the reset map makes of them, shape (c,) each."""

    def pushed(z: Scalar, along: Scalar) -> Scalar:
        return jax.jvp(flow.reset, (z,), (along,))[1]

    change = jnp.concatenate([second, jnp.zeros(len(z) - len(second))])
    return jax.jvp(pushed, (z, q), (v, change))

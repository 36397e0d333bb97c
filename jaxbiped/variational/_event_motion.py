"""Motion of an event: how the time at which a surface is reached depends on the state."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar
from jaxbiped.variational._tangents import Seeded, Tangents, along_columns, as_columns

_NEAR = 1e-3
"""Time from the event, in units of time, beyond which it is not known where that lies."""


class EventMotion(NamedTuple):
    """An event near a state, and how it moves in n directions.

    Attributes:
        delay: from the state to the event [s].
        time, state: derivatives of its time, shape (n,), and of the state at it, (n, c).
    """

    delay: Scalar
    time: Scalar
    state: Scalar


def follow_event(
    surface: Callable[[PyTree, PyTree], Scalar],
    field: Callable[[PyTree, PyTree], PyTree],
    at: Tangents,
    args: Seeded,
    *,
    rtol: RealScalarLike,
    unit: RealScalarLike,
) -> EventMotion:
    """Derivatives of an event's time and of the state at it.

    By the implicit function theorem: where g(y(t, p), p) = 0, dt = −(g' dy + g_p dp)/ġ, and the
    state at the event moves by dy + f dt. NaN where the event is not near, or where it grazes: the
    surface's rate is so small that an error of the state makes it turn back.

    Args:
        surface: g of (args, state), zero at the event.
        field: f of (args, state).
        at: the state there, and its columns at a fixed time.
        args: the arguments, and their seeds.
        rtol: relative error that the state may have.
        unit: of time [s].
    """

    def value(y: PyTree, a: PyTree) -> Scalar:
        return surface(a, y)

    def rate(y: PyTree) -> Scalar:
        return jax.jvp(lambda s: surface(args.args, s), (y,), (field(args.args, y),))[1]

    here, along = along_columns(value, at, args)
    velocity = field(args.args, at.state)
    speed, turning = jax.jvp(rate, (at.state,), (velocity,))
    normal = jax.grad(lambda y: surface(args.args, y))(at.state)
    sizes = jtu.tree_map(lambda n, y: jnp.abs(n * y), normal, at.state)
    known_to = rtol * sum(jtu.tree_leaves(sizes))
    grazes = speed * speed <= 2.0 * jnp.abs(turning) * known_to
    is_near = jnp.abs(here) <= _NEAR * unit * jnp.abs(speed)
    time = jnp.where(grazes | ~is_near, jnp.nan, -along / speed)
    state = at.columns.T + time[:, None] * as_columns(velocity)[None]
    return EventMotion(-here / speed, time, state)

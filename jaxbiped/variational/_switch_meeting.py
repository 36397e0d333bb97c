"""Meeting of motions at a switch: derivatives at the moment at which each of them passes it."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.variational._tangents import Seeded, active_leaves, with_active
from jaxbiped.variational._watch import Watch


class SwitchMeeting(NamedTuple):
    """How much later displaced motions meet a switch g = 0, and how fast they go there.

    A motion displaced by dy meets it later by τ = −(by_state · dy + by_parameter · dp), where it is
    displaced by dy + rates τ.

    Attributes:
        by_state, by_parameter: g'/ġ, shape (c,), and g_p/ġ, shape (p,).
        rates: of the state just before, shape (c,).
    """

    by_state: Scalar
    by_parameter: Scalar
    rates: Scalar


def has_field_switches(watch: Watch, state: PyTree, args: PyTree) -> bool:
    """Whether the field is not smooth anywhere; known before anything runs."""
    return any(not switch.corner for switch in watch.switches(args, state))


def meeting_at(watch: Watch, state: PyTree, args: Seeded, which: Scalar) -> SwitchMeeting:
    """At a state just before the switch of this number, counted from one."""
    leaves, structure = jtu.tree_flatten(state)
    q = active_leaves(args)

    def value(y: list[Scalar], p: list[Scalar]) -> Scalar:
        found = watch.switches(with_active(args, p), jtu.tree_unflatten(structure, y))
        picked = jnp.zeros(())
        for number, switch in enumerate(found):
            if not switch.corner:
                picked = jnp.where(which == 1 + number, switch.value, picked)
        return picked

    rates = jnp.stack(jtu.tree_leaves(watch.field(jnp.zeros(()), state, args.args)))
    by_state, by_parameter = jax.grad(value, argnums=(0, 1))(leaves, q)
    normal = jnp.stack(by_state)
    rate = jnp.sum(normal * rates)
    inverse = 1.0 / jnp.where(rate == 0.0, jnp.finfo(rate.dtype).tiny, rate)
    along = jnp.stack(by_parameter) if q else jnp.zeros(0, rate.dtype)
    return SwitchMeeting(normal * inverse, along * inverse, rates)


def meet(
    meeting: SwitchMeeting, columns: Sequence[Scalar], shifts: Sequence[Scalar], sizes: Scalar
) -> tuple[list[Scalar], tuple[Scalar, ...]]:
    """Columns and shifts at the switch; the last p columns move parameters by their `sizes`."""

    def follow(column: Scalar, shift: Scalar, forcing: Scalar) -> tuple[Scalar, Scalar]:
        later = -(jnp.sum(meeting.by_state * column) + forcing)
        return column + meeting.rates * later, shift + later

    forcings = jnp.zeros(len(columns[0])), meeting.by_parameter * sizes
    parts = zip(columns, shifts, forcings, strict=True)
    both = [
        jax.lax.map(lambda each: follow(*each), part) if len(part[0]) else part[:2]
        for part in parts
    ]
    met, later = zip(*both, strict=True)
    return list(met), later


def at_fixed_time(
    rates: PyTree, columns: Sequence[Scalar], shifts: Sequence[Scalar]
) -> list[Scalar]:
    """Columns at a fixed time where the state changes at these rates."""
    velocity = jnp.stack(jtu.tree_leaves(rates))
    pairs = zip(columns, shifts, strict=True)
    return [column - shift[:, None] * velocity for column, shift in pairs]

"""Tangents at a switch: where displaced motions meet it, saltation, and resets of the state."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, select
from jaxbiped.compiler import fusion_barrier
from jaxbiped.solve._watch import Watch
from jaxbiped.variational._tangents import (
    Seeded,
    Tangents,
    active_leaves,
    along_columns_in_turn,
    as_columns,
    with_active,
)

_BEYOND = 1e-3
"""How far across a surface its other side is looked at, as a share of the distance to it."""


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


def field_switch_values(watch: Watch, state: PyTree, args: PyTree) -> list[Scalar]:
    """Values of the switches where the field itself is not smooth; how many is known before."""
    return [each.value for each in watch.switches(args, state) if not each.corner]


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
    return [jax.lax.map(lambda each: each[0] - each[1] * velocity, pair) for pair in pairs]


class Saltation(NamedTuple):
    """The jump of a column dy across a surface: change · (by_state · dy + by_parameter · dp).

    A motion displaced by dy meets the surface g = 0 earlier by g' dy / ġ, and is carried for that
    long by the field f⁺ behind it in place of f⁻ before it: dy jumps by
    (f⁺ − f⁻) (g' dy + g_p dp) / ġ⁻.

    Attributes:
        change: (f⁺ − f⁻)/ġ⁻, shape (c,).
        by_state, by_parameter: derivatives of g with respect to the state, shape (c,), and to the
            active parameters, shape (p,).
        which: which of the field's switches it is (booleans).
    """

    change: Scalar
    by_state: Scalar
    by_parameter: Scalar
    which: Scalar


def saltation_at(watch: Watch, state: PyTree, args: Seeded, happens: Scalar) -> Saltation:
    """The saltation at a state that lies just past a switch where the field is not smooth.

    A field that is infinitely steep behind it has changed by then as if it had jumped. Of several
    switches it is the one that was passed last. Zero where it does not `happen`.
    """
    leaves, structure = jtu.tree_flatten(state)
    q = active_leaves(args)

    def values(y: list[Scalar], p: list[Scalar]) -> list[Scalar]:
        return field_switch_values(watch, jtu.tree_unflatten(structure, y), with_active(args, p))

    def field(y: list[Scalar]) -> Scalar:
        rates = watch.field(jnp.zeros_like(leaves[0]), jtu.tree_unflatten(structure, y), args.args)
        return jnp.stack(jtu.tree_leaves(rates))

    def beyond(k: int, value: Scalar, normal: Scalar) -> Scalar:
        """The field on the other side of surface k, as near as rounding allows."""
        rounding = 8.0 * jnp.finfo(value.dtype).eps
        other = jnp.abs(value) * _BEYOND + rounding
        shift = (jnp.where(value > 0.0, -other, other) - value) / jnp.sum(normal * normal)
        return field([leaf + shift * part for leaf, part in zip(leaves, normal, strict=True)])

    def compute() -> Saltation:
        after = field(leaves)
        slopes = jax.jacrev(values, argnums=(0, 1))(leaves, q)
        found, nearest = None, jnp.zeros(())
        surfaces = values(leaves, q)
        for k, value in enumerate(surfaces):
            which = jnp.arange(len(surfaces)) == k
            normal, along = jnp.stack(slopes[k][0]), slopes[k][1]
            before = beyond(k, value, normal)
            rate = jnp.sum(normal * before)
            safe = jnp.where(rate == 0.0, jnp.finfo(rate.dtype).tiny, rate)
            by_parameter = jnp.stack(along) if along else jnp.zeros(0, dtype=rate.dtype)
            saltation = Saltation((after - before) / safe, normal, by_parameter, which)
            delay = jnp.abs(value / safe)
            closer = delay < nearest
            found = saltation if found is None else select(closer, saltation, found)
            nearest = delay if k == 0 else jnp.where(closer, delay, nearest)
        assert found is not None
        return found

    found = fusion_barrier(happens, compute)
    return found._replace(change=jnp.where(happens, found.change, 0.0))


def behind_reset(
    watch: Watch, args: Seeded, sizes: Scalar, state: PyTree, columns: list[Scalar], which: Scalar
) -> tuple[PyTree, list[Scalar]]:
    """The state behind a switch that resets it, and its columns there.

    Columns are those where all motions meet the switch, so that the reset's own derivative is all
    that changes them.

    Args:
        watch: has the reset.
        args: the arguments and their active leaves.
        sizes: by how much each of the last columns moves its parameter.
        state: on the switch.
        columns: of the directions of the state, then of those of parameters, shapes (n, c).
        which: the switch's number, from 1 on.
    """
    reset, q = watch.reset, active_leaves(args)
    leaves, structure = jtu.tree_flatten(state)
    assert reset is not None

    def behind(leaves: list[Scalar], q: list[Scalar]) -> list[Scalar]:
        before = jtu.tree_unflatten(structure, leaves)
        return jtu.tree_leaves(reset(with_active(args, q), before, which))

    def along(each: tuple[Scalar, Scalar]) -> Scalar:
        return jnp.stack(jax.jvp(behind, (leaves, q), tuple(map(list, each)))[1])

    seeds = jnp.zeros((len(columns[0]), len(q))), jnp.diag(sizes)
    pairs = zip(columns, seeds, strict=True)
    moved = [jax.lax.map(along, pair) if len(pair[0]) else pair[0] for pair in pairs]
    return jtu.tree_unflatten(structure, behind(leaves, q)), moved


def behind_arrival(watch: Watch, y: Tangents, args: Seeded) -> Tangents:
    """A state on the section and its columns there, as the watch's `arrival` makes them."""
    arrival = watch.arrival
    if arrival is None:
        return y
    state, moved = along_columns_in_turn(lambda s, a: arrival(a, s), y, args)
    return Tangents(state, as_columns(moved))

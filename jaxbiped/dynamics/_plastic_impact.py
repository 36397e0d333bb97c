"""Plastic impact of a mechanism on rigid feet: of soles that come down, of stops that are hit."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._holds import holds_of
from jaxbiped.dynamics._implicit_field import fold, fold_matrix
from jaxbiped.dynamics._joint_loads import of_all_bodies
from jaxbiped.dynamics._stance import Sole, Stance, either, sole_of
from jaxbiped.dynamics._tree import Loads
from jaxbiped.linalg._sparse_lu import factorise, plus, product
from jaxbiped.scene._modes import Modes
from jaxbiped.scene._structure import Indices


class Impulse(NamedTuple):
    """An impulse on the root point in the slope's frame [N·s], leaves shaped as the state's."""

    x: Scalar
    z: Scalar


class Grip(NamedTuple):
    """Which limits of stops take part in an impact, and which only while they are pressed on."""

    held: Sequence[Scalar]
    loose: Sequence[Scalar | bool]


class Struck(NamedTuple):
    """After a plastic impact.

    Attributes:
        stance: on what stands then.
        impulse: of the ground on it [N·s].
        stands: which of two feet stand; none of a leg that has one.
        held: which limits are held.
    """

    stance: Stance
    impulse: Impulse
    stands: tuple[Scalar, ...]
    held: Sequence[Scalar]


class _Outcome(NamedTuple):
    rates: tuple[Scalar, ...]
    impulse: Impulse
    turning: Scalar
    held: list[Scalar]


def plastic_impact(
    old: Stance,
    feet: Indices,
    stands: tuple[Scalar, ...],
    push_off: Impulse | None,
    modes: Modes,
    grip: Grip,
) -> Struck:
    """Brings the soles of a leg to rest on the ground at once, and what is held to rest.

    Of two feet and of loose limits those stay that are pressed on, while the others leave; of two
    feet at least one.

    Args:
        old: the motion before.
        feet: of the leg that stands afterwards.
        stands: which of two feet come down or stand; none for one foot.
        push_off: an impulse on the root point at once before.
        modes: of the mechanism.
        grip: what is held beside the feet.
    """
    first = sole_of(old.mechanism, feet[0])
    if not stands:
        found = _on(old, first, None, push_off, modes, grip)
        return Struck(old.on(first, found.rates), found.impulse, (), found.held)
    second = sole_of(old.mechanism, feet[1])
    flat = stands[0] & stands[1]
    found = _on(old, either(stands[0], first, second), flat, push_off, modes, grip)
    front = found.turning / (old.point(second).x - old.point(first).x)
    tips = flat & (jnp.minimum(front, found.impulse.z - front) < 0.0)
    no = jnp.zeros_like(flat)
    one, other = (_on(old, sole, no, push_off, modes, grip) for sole in (first, second))
    rises = old.on(first, one.rates).point(second).vz >= 0.0
    # Where neither presses alone the walker would have to fly: what pulls less stays.
    stays = rises & ((one.impulse.z >= 0.0) | (one.impulse.z >= other.impulse.z))
    found = select(tips, select(stays, one, other), found)
    stands = stands[0] & ~(tips & ~stays), stands[1] & ~(tips & stays)
    sole = either(stands[0], first, second)
    return Struck(old.on(sole, found.rates), found.impulse, stands, found.held)


def _on(
    old: Stance,
    sole: Sole,
    flat: Scalar | None,
    push_off: Impulse | None,
    modes: Modes,
    grip: Grip,
) -> _Outcome:
    """Rates of all bodies after it, on a sole of a body that is `flat`, where it has two feet."""
    new, lands, rates = old.on(sole), old.point(sole), old.pose.motion.rates
    tree, rolled = new.tree, new.pose.motion
    structure = tree.structure
    lost_x, lost_z = lands.vx - rolled.vx, lands.vz - rolled.vz
    entries = new.mass_matrix()
    found = product(entries, {0: lost_x, 1: lost_z})
    momenta = [found.get(i) for i in range(2 + len(rates))]
    if push_off is not None:
        kick = Loads.none(structure).with_force(new.root, push_off.x, push_off.z)
        momenta = [plus(*each) for each in zip(momenta, kick.entries(), strict=True)]
    factors = factorise(fold_matrix(tree.weights, entries))
    gained: Any = factors.solve(fold(tree.weights, momenta))
    turning, held = jnp.zeros_like(rates[0]), list(grip.held)
    if new.may_hold:
        holds = holds_of(new, modes, factors)
        start = {row: rates[j] for row, j in zip(tree.rows, structure.free, strict=True)}
        free = {row: rate + gained[row] for row, rate in start.items()}
        always = [] if flat is None else [flat]
        held = holds.pressed(free, [*always, *held], [*([False] * len(always)), *grip.loose])
        reactions = holds.reactions(free, held)
        after = holds.under(free, reactions)
        gained = {row: after[row] - rate for row, rate in start.items()}
        if flat is not None:
            turning = reactions[0]
        held = held[len(always) :]
    moves = tree.free_values(gained)
    gains = of_all_bodies(structure, moves, moves[0])
    after_rates = tuple(rate + gain for rate, gain in zip(rates, gains, strict=True))
    then = old.on(sole, after_rates).pose.motion
    moved = {0: then.vx - lands.vx, 1: -lands.vz}
    given: Any = product(entries, moved | {2 + j: gain for j, gain in enumerate(gains)})
    x, z = given[0], given[1]
    if push_off is not None:
        x, z = x - push_off.x, z - push_off.z
    return _Outcome(after_rates, Impulse(x, z), turning, held)

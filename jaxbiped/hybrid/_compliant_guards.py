"""Guards of a walker with laws of contact: switches, gaps, and changes of a contact's kind."""

import functools
import operator
from typing import Any

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.dynamics._contacts import feet, foot_force, legs_at, limits_of
from jaxbiped.dynamics._equivalent_states import CompliantState, strike_leg_of
from jaxbiped.dynamics._footfalls import FootMotion, carrier_place, leg_places, touches
from jaxbiped.hybrid._guards import Gap, Switch
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw
from jaxbiped.scene.laws.friction._coulomb import Frictionless

_SAME_SLIP = 3.0
"""Factor by which the slip speed may change in a step: a Stribeck curve is bent on that scale."""


def switches(scene: CompliantScene, state: CompliantState) -> tuple[Switch, ...]:
    """All switches of a scene: those of its feet and those of its stops.

    A foot has switches at touchdown, where its reaction leaves zero, at slip speeds of ±v0 and 0,
    and for the clearance rule. A stop has switches at its limits, and where its torque leaves zero.
    Springs and latches are smooth.

    Source: the seed paper, section 2.2, whose laws have these corners.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: scalar leaves, SI units.

    Returns:
        The switches of each foot, then those of each stop; their number depends only on the scene.
    """
    structure, legs = scene.mechanism.structure, legs_at(scene, state)
    found: list[Switch] = []
    for foot, leg in zip(feet(scene, state), structure.leg_of_foot, strict=True):
        found += _foot_switches(scene, foot, legs[leg].rate)
    for law, limit in limits_of(scene, state):
        depth, rate = limit.penetration, limit.rate
        found.append(_touchdown(law, depth, True))
        found += [Switch(value, depth > 0.0, corner=True) for value in law.switches(depth, rate)]
    return tuple(found)


def _touchdown(law: AbstractNormalLaw, depth: Scalar, live: Scalar | bool) -> Switch:
    jumps = law.jumps_at_touchdown
    return Switch(depth, live, force_jumps=jumps, first_only=jumps or law.steep_at_touchdown)


def _foot_switches(scene: CompliantScene, foot: FootMotion, rate: Scalar) -> list[Switch]:
    if foot.admitted is False:
        return []
    below, touching = foot.penetration > 0.0, touches(foot)
    admitted = True if foot.admitted is None else foot.admitted
    carries = foot_force(scene, foot).normal > 0.0
    found = [_touchdown(scene.normal, foot.penetration, admitted)]
    reaction = scene.normal.switches(foot.penetration, foot.penetration_rate)
    found += [Switch(value, touching, corner=True) for value in reaction]
    slips = scene.friction.switches(foot.slip_speed)
    found += [Switch(value, carries, corner=True) for value in slips]
    if foot.admitted is not None:
        pressed = below & (scene.normal.force(foot.penetration, foot.penetration_rate) > 0.0)
        found.append(Switch(rate, pressed, force_jumps=True))
    return found


def strikes(scene: CompliantScene, state: Any) -> tuple[Switch, ...]:
    """The surface at which each leg strikes: it comes to touch, ahead of who carries.

    It is a footstep, as `landings` tells them, where another leg made the last one; the clock of
    the state restarts there.

    Args:
        scene: the walker, whose states have a clock.
        state: scalar leaves, SI units.

    Returns:
        The switches of the legs, in their order.
    """
    structure, found = scene.mechanism.structure, feet(scene, state)
    height, legs = scene.mechanism.height, legs_at(scene, state)
    pace, places = jnp.sqrt(height / scene.ground.g), leg_places(structure, found)
    switches = []
    for leg, own in enumerate(structure.feet_of_leg):
        value = jnp.ones_like(height)
        for foot in (found[k] for k in own if found[k].admitted is not False):
            off = -foot.penetration / height
            if foot.admitted is not None:
                turns = jnp.abs(legs[leg].rate) * pace
                off = jnp.maximum(off, jnp.where(foot.admitted, -turns, turns))
            value = jnp.minimum(value, off)
        live: Scalar | bool = True
        if (carrier := carrier_place(structure, found, places, leg)) is not None:
            value = jnp.maximum(value, (carrier - places[leg]) / height)
            live = jnp.abs(state.strike_leg - strike_leg_of(structure, leg)) > 0.5
        switches.append(
            Switch(value, live, force_jumps=True, resets=True, first_only=True, rises=True)
        )
    return tuple(switches)


def gaps(scene: CompliantScene, state: CompliantState) -> tuple[Gap, ...]:
    """All gaps of a scene: those of its feet, then those of its stops."""
    height = scene.mechanism.height
    under = [
        Gap(foot.penetration, foot.penetration_rate, foot.admitted, height)
        for foot in feet(scene, state)
    ]
    limits = limits_of(scene, state)
    at_stops = [Gap(limit.penetration, limit.rate, None, 1.0) for _, limit in limits]
    return (*under, *at_stops)


def contact_changes(scene: CompliantScene, y0: PyTree, y1: PyTree) -> Scalar:
    """Whether a contact is of a different kind at a step's end than at its start (boolean).

    The kind of a stop is whether it is pressed. The kind of a foot is whether it carries load, in
    which direction it slips, and whether below the slip speed of friction's peak, above it, or
    much faster.
    """
    found = jnp.zeros(jnp.shape(y0[0]), dtype=bool)
    for before, after in zip(feet(scene, y0), feet(scene, y1), strict=True):
        if before.admitted is not False:
            found = found | _changes(scene, before, after)
    stops = zip(limits_of(scene, y0), limits_of(scene, y1), strict=True)
    for (law, *was), (_, *now) in stops:
        pressed = (law.force(each.penetration, each.rate) > 0.0 for each in (*was, *now))
        found = found | functools.reduce(operator.ne, pressed)
    return found


def _changes(scene: CompliantScene, before: FootMotion, after: FootMotion) -> Scalar:
    carried, carries = (foot_force(scene, foot).normal > 0.0 for foot in (before, after))
    if isinstance(scene.friction, Frictionless):
        return carried != carries
    old, new = before.slip_speed, after.slip_speed
    slow, fast = jnp.abs(old), jnp.abs(new)
    changes = (fast > _SAME_SLIP * slow) | (slow > _SAME_SLIP * fast) | ((old > 0.0) != (new > 0.0))
    friction = scene.friction.switches
    for one, other in zip(friction(old), friction(new), strict=True):
        changes = changes | ((one > 0.0) != (other > 0.0))
    return (carried != carries) | (carries & changes)

"""Surfaces of the state on which the endings of a compliant walk lie."""

import functools
from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar
from jaxbiped.dynamics._contacts import feet, legs_at
from jaxbiped.dynamics._energy import energies
from jaxbiped.dynamics._equivalent_states import minimal_state
from jaxbiped.dynamics._footfalls import FootMotion, LegMotion, leg_places, touching_legs
from jaxbiped.scene._ground import StanceRotation
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._structure import Structure
from jaxbiped.solve._failure_events import (
    REST_ENERGY,
    REST_RATE,
    STUMBLE_SPEED,
    energy_unit,
    fall_height,
    foot_pairs,
    has_fallen,
    has_stumbled,
    rate_unit,
    root_height,
    speed_unit,
)


def ending_surface(code: Scalar, scene: PyTree, end: PyTree, y: PyTree) -> Scalar:
    """Rises through zero where a compliant walk comes to the ending of a `code`.

    Of "walking" it is the last heel strike. Where several conditions make an ending, it is the one
    that is met last. NaN for endings that no state decides.

    Args:
        code: of an `Ending`.
        scene: what walks, in minimal or redundant coordinates.
        end: a state just past the ending, which decides between causes of the same code.
        y: the state of which the value is wanted.
    """
    minimal: PyTree = minimal_state(scene, y)
    past: PyTree = minimal_state(scene, end)
    structure, found = scene.mechanism.structure, feet(scene, y)
    legs = legs_at(scene, y)
    held = [
        _contact(scene, foot, legs[leg].rate)
        for foot, leg in zip(found, structure.leg_of_foot, strict=True)
    ]
    of_legs = [_most(*(held[k] for k in each)) for each in structure.feet_of_leg]
    fallen = fall_height(scene) - root_height(scene, minimal)
    barred = _turning(scene, found, legs)
    stumbled = _stumble(scene, found, held)
    values = {
        Ending.WALKING: _of_first_leg(structure, feet(scene, end), of_legs),
        Ending.FELL_FORWARD: jnp.where(has_fallen(scene, past), fallen, barred),
        Ending.FELL_BACK: fallen,
        Ending.STOPPED: _rest(scene, found, legs, of_legs, minimal),
        Ending.STUMBLED: jnp.where(has_stumbled(scene, past), stumbled, barred),
    }
    value = jnp.full_like(fallen, jnp.nan)
    for name, each in values.items():
        value = jnp.where(code == int(name), each, value)
    return value


def _least(*values: Scalar) -> Scalar:
    return functools.reduce(jnp.minimum, values)


def _most(*values: Scalar) -> Scalar:
    return functools.reduce(jnp.maximum, values)


def _of_first_leg(
    structure: Structure, feet_then: Sequence[FootMotion], values: Sequence[Scalar]
) -> Scalar:
    """The value of the leg that stands ahead of the others that touch."""
    places, value = leg_places(structure, feet_then), values[0]
    touching = touching_legs(structure, feet_then)
    first = jnp.where(touching[0], places[0], -jnp.inf)
    for place, touched, each in zip(places[1:], touching[1:], values[1:], strict=True):
        ahead = touched & (place >= first)
        first, value = jnp.where(ahead, place, first), jnp.where(ahead, each, value)
    return value


def _contact(scene: Scene, foot: FootMotion, rate: Scalar) -> Scalar:
    """Above zero where a foot touches."""
    if not isinstance(scene.clearance, StanceRotation):
        return foot.penetration
    return jnp.minimum(foot.penetration, -rate)


def _depths(structure: Structure, found: Sequence[FootMotion]) -> list[Scalar]:
    """Of each leg how deep its deepest foot is [m]."""
    return [_most(*(found[k].penetration for k in leg)) for leg in structure.feet_of_leg]


def _turning(scene: Scene, found: Sequence[FootMotion], legs: Sequence[LegMotion]) -> Scalar:
    """Above zero where a leg with a foot under the ground turns back; see `is_barred`."""
    if not isinstance(scene.clearance, StanceRotation):
        return jnp.full_like(legs[0].rate, -jnp.inf)
    slow = REST_RATE * rate_unit(scene)
    depths = _depths(scene.mechanism.structure, found)
    return _most(
        *(
            jnp.where(leg.rate < 0.0, -jnp.inf, _least(depth, slow - leg.rate))
            for depth, leg in zip(depths, legs, strict=True)
        )
    )


def _rest(
    scene: Scene,
    found: Sequence[FootMotion],
    legs: Sequence[LegMotion],
    held: Sequence[Scalar],
    state: PyTree,
) -> Scalar:
    """Above zero where the leg that stands alone is at rest, or all the walker is."""
    if not isinstance(scene.clearance, StanceRotation):
        still = REST_ENERGY * energy_unit(scene) - energies(scene, state).kinetic
        return jnp.minimum(_most(*held), still)
    slow = REST_RATE * rate_unit(scene)
    at_rest = []
    for i, depth in enumerate(_depths(scene.mechanism.structure, found)):
        others = (-each for k, each in enumerate(held) if k != i)
        at_rest.append(_least(depth, legs[i].rate + slow, *others))
    return _most(*at_rest)


def _stumble(scene: Scene, found: Sequence[FootMotion], held: Sequence[Scalar]) -> Scalar:
    """Above zero where a rear foot comes down, moving forward, while another leg carries."""
    least = STUMBLE_SPEED * speed_unit(scene)

    def trips(i: int, j: int) -> Scalar:
        rear, front = found[i], found[j]
        entering = rear.penetration_rate - jnp.maximum(front.penetration_rate, 0.0)
        fast = _least(rear.penetration_rate - least, rear.slip_speed - least)
        return _least(held[i], held[j], front.x - rear.x, entering, fast)

    pairs = foot_pairs(scene.mechanism.structure)
    return _most(jnp.full_like(held[0], -jnp.inf), *(trips(i, j) for i, j in pairs))

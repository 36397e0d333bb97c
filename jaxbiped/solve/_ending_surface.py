"""Ending surfaces: functions of the state whose zero is the moment at which a simulation ends."""

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar
from jaxbiped.dynamics._energy import energies
from jaxbiped.dynamics._feet import Foot, feet
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.scene._ground import StanceRotation
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._ending import (
    REST_ENERGY,
    REST_RATE,
    STUMBLE_SPEED,
    fall_height,
    has_fallen,
    has_stumbled,
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
    both = feet(scene, y)
    held = [_contact(scene, foot, rate) for foot, rate in zip(both, _rates(minimal), strict=True)]
    feet_then = feet(scene, end)
    fallen = fall_height(scene) - minimal.hip_z
    barred = _turning(scene, both, minimal)
    stumbled = _stumble(scene, both, held)
    values = {
        Ending.WALKING: jnp.where(feet_then.foot_1.x > feet_then.foot_2.x, held[0], held[1]),
        Ending.FELL_FORWARD: jnp.where(has_fallen(scene, past), fallen, barred),
        Ending.FELL_BACK: fallen,
        Ending.STOPPED: _rest(scene, both, minimal, held),
        Ending.STUMBLED: jnp.where(has_stumbled(scene, past), stumbled, barred),
    }
    found = jnp.full_like(fallen, jnp.nan)
    for name, value in values.items():
        found = jnp.where(code == int(name), value, found)
    return found


def _rates(state: PyTree) -> tuple[Scalar, Scalar]:
    return state.omega_1, state.omega_2


def _least(*values: Scalar) -> Scalar:
    least = values[0]
    for value in values[1:]:
        least = jnp.minimum(least, value)
    return least


def _contact(scene: Scene, foot: Foot, rate: Scalar) -> Scalar:
    """Above zero where a foot touches."""
    if not isinstance(scene.clearance, StanceRotation):
        return foot.penetration
    return jnp.minimum(foot.penetration, -rate)


def _turning(scene: Scene, both: tuple[Foot, Foot], state: PyTree) -> Scalar:
    """Above zero where a leg whose foot is under the ground turns back; see `is_barred`."""
    if not isinstance(scene.clearance, StanceRotation):
        return jnp.full_like(state.hip_z, -jnp.inf)
    slow = REST_RATE * jnp.sqrt(scene.ground.g / scene.walker.l)
    legs = zip(both, _rates(state), strict=True)
    first, second = (
        jnp.where(rate < 0.0, -jnp.inf, _least(foot.penetration, slow - rate))
        for foot, rate in legs
    )
    return jnp.maximum(first, second)


def _rest(scene: Scene, both: tuple[Foot, Foot], state: PyTree, held: list[Scalar]) -> Scalar:
    """Above zero where the leg that stands alone is at rest, or all the walker is."""
    if not isinstance(scene.clearance, StanceRotation):
        unit = scene.walker.total_mass * scene.ground.g * scene.walker.l
        still = REST_ENERGY * unit - energies(scene, state).kinetic
        return jnp.minimum(jnp.maximum(*held), still)
    slow = REST_RATE * jnp.sqrt(scene.ground.g / scene.walker.l)
    first, second = (
        _least(foot.penetration, rate + slow, -held[1 - i])
        for i, (foot, rate) in enumerate(zip(both, _rates(state), strict=True))
    )
    return jnp.maximum(first, second)


def _stumble(scene: Scene, both: tuple[Foot, Foot], held: list[Scalar]) -> Scalar:
    """Above zero where the rear foot comes down, moving forward, while the other carries."""
    least = STUMBLE_SPEED * jnp.sqrt(scene.ground.g * scene.walker.l)

    def trips(rear: Foot, front: Foot) -> Scalar:
        entering = rear.penetration_rate - jnp.maximum(front.penetration_rate, 0.0)
        fast = _least(rear.penetration_rate - least, rear.slip_speed - least)
        return _least(*held, front.x - rear.x, entering, fast)

    return jnp.maximum(trips(*both), trips(both[1], both[0]))

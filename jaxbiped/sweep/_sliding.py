"""Sliding of the feet along the ground."""

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._feet import feet, touches
from jaxbiped.dynamics._state import State
from jaxbiped.scene._scene import Scene


def contact_places(scene: Scene, state: State) -> tuple[Scalar, Scalar]:
    """For each foot, the place [m] that changes by what it slips: its rate is the slip speed."""
    both = feet(scene, state)
    return (
        both.foot_1.x + scene.walker.r * state.theta_1,
        both.foot_2.x + scene.walker.r * state.theta_2,
    )


def slip_distances(
    scene: Scene, state: State, landed: tuple[Scalar, Scalar]
) -> tuple[tuple[Scalar, Scalar], Scalar]:
    """The places at which the feet last came down, and how far the worse one has slid since [m].

    Args:
        scene: with the ground.
        state: now.
        landed: the places a step ago; see `contact_places`.
    """
    both, places = feet(scene, state), contact_places(scene, state)
    kept = [
        jnp.where(touches(foot), old, new)
        for foot, old, new in zip(both, landed, places, strict=True)
    ]
    slid = [jnp.abs(new - old) for old, new in zip(kept, places, strict=True)]
    return (kept[0], kept[1]), jnp.maximum(slid[0], slid[1])

"""Contacts of both feet: kinematics and forces."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._feet import Feet, feet, touches
from jaxbiped.dynamics._forces import FootForces, foot_forces
from jaxbiped.dynamics._redundant_state import CompliantState
from jaxbiped.scene._scene import CompliantScene


class Contacts(NamedTuple):
    """Feet, whether each touches, and the forces on them; leaves shaped as the state's."""

    feet: Feet
    touching: tuple[Scalar, Scalar]
    forces: FootForces

    @property
    def both_carry(self) -> Scalar:
        """Whether both feet carry something (boolean): double support."""
        return (self.forces.foot_1.normal > 0.0) & (self.forces.foot_2.normal > 0.0)


def contacts(scene: CompliantScene, state: CompliantState) -> Contacts:
    """Both feet's contacts with the ground."""
    both = feet(scene, state)
    first, second = (jnp.broadcast_to(touches(foot), foot.x.shape) for foot in both)
    return Contacts(both, (first, second), foot_forces(scene, state))

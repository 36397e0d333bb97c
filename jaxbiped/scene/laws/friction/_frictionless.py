"""No friction."""

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw


class Frictionless(AbstractFrictionLaw):
    """No tangential force. The equations of motion leave friction out altogether."""

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        return jnp.zeros_like(normal_force)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()

"""No friction."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay


class Frictionless(AbstractFrictionLaw):
    """No tangential force. The equations of motion leave friction out altogether."""

    name: ClassVar[str] = "frictionless"

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        return jnp.zeros_like(normal_force)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """The law itself: there is nothing to take from the seed's."""
        return cls()

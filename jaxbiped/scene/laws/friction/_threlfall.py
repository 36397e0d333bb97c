"""Threlfall's friction law."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay


class Threlfall(AbstractFrictionLaw):
    """Dry friction that builds up exponentially and is held from v0 on.

    With F_C = mu F_N and s = |V_T|:

    - s ≤ v0: F = F_C (1 − exp(−3 s/v0))
    - s > v0: F = F_C (1 − e⁻³), about 0.95 F_C

    Source: Threlfall, Mechanism and Machine Theory 13 (1978) 475. Publications differ above v0:
    some take F_C. This is the continuous reading.

    Attributes (leaves of any batch shape):
        mu: coefficient of friction; a twentieth more than what is reached [–].
        v0: slip speed from which the force is constant [m/s].

    Raises:
        ArgumentError: mu below 0 or v0 not above 0.
    """

    name: ClassVar[str] = "threlfall"
    builds_up_over: ClassVar[str | None] = "v0"
    mu: Parameter = parameter("friction coefficient", r"$\mu$", minimum=0.0)
    v0: Parameter = parameter("slip of full friction", "$v_0$", "m/s", positive=True)

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        backwards = slip_speed < 0.0
        # Of |V_T| and sign(V_T) automatic differentiation would make a slope of zero at rest.
        speed = jnp.where(backwards, -slip_speed, slip_speed)
        ratio = jnp.where(speed < self.v0, speed / self.v0, 1.0)
        size = self.mu * normal_force * (1.0 - jnp.exp(-3.0 * ratio))
        return jnp.where(backwards, size, -size)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        # At rest it is the second derivative that jumps.
        return slip_speed - self.v0, slip_speed + self.v0, slip_speed

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """The kinetic coefficient, from rest with the slope 3 mu/v0 and held from v0 on."""
        return cls(mu=seed.mu_kinetic, v0=seed.v0)

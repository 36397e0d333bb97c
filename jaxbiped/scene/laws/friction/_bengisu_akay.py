"""The seed's friction law, with its Stribeck peak."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import check_not_negative, check_positive
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw


class BengisuAkay(AbstractFrictionLaw):
    """Regularised dry friction that rises to its static peak at v0 and decays to kinetic.

    With F_S = mu_static F_N, F_C = mu_kinetic F_N and s = |V_T|:

    - s < v0: F = F_S − (F_S/v0²)(s − v0)²
    - s ≥ v0: F = F_C + (F_S − F_C) exp(−xi (s − v0))

    Source: the seed paper, section 2.2, after Bengisu and Akay. Its printed first branch lost a
    minus sign, a square and a bracket; this reading alone is zero at rest and continuous at v0.

    Attributes (leaves of any batch shape):
        mu_static: static coefficient, reached at v0 [–].
        mu_kinetic: kinetic coefficient, reached far above v0 [–].
        v0: slip speed of the peak [m/s].
        xi: Stribeck rate, the decay above v0 [s/m].

    Raises:
        ArgumentError: a coefficient or xi below 0, or v0 not above 0.
    """

    builds_up_over: ClassVar[str | None] = "v0"
    mu_static: Parameter = eqx.field(converter=as_float)
    mu_kinetic: Parameter = eqx.field(converter=as_float)
    v0: Parameter = eqx.field(converter=as_float)
    xi: Parameter = eqx.field(converter=as_float)

    def __check_init__(self) -> None:
        check_not_negative("mu_static", self.mu_static)
        check_not_negative("mu_kinetic", self.mu_kinetic)
        check_positive("v0", self.v0, "m/s")
        check_not_negative("xi", self.xi, "s/m")

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        u = slip_speed / self.v0
        speed = jnp.abs(slip_speed)
        sticking = speed < self.v0
        # u (2 − |u|) is the first branch written so that its slope at rest is exact.
        rise = self.mu_static * u * (2.0 - jnp.abs(u))
        beyond = jnp.where(sticking, 0.0, speed - self.v0)
        decay = self.mu_kinetic + (self.mu_static - self.mu_kinetic) * jnp.exp(-self.xi * beyond)
        return -normal_force * jnp.where(sticking, rise, jnp.sign(slip_speed) * decay)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        # At rest it is the second derivative that jumps.
        return slip_speed - self.v0, slip_speed + self.v0, slip_speed

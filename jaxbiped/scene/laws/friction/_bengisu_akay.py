"""The seed's friction law, with its Stribeck peak, and its smooth counterpart."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw, smooth_ramp


class AbstractPeakedFriction(AbstractFrictionLaw):
    """Friction that peaks at the slip speed v0 and decays above it with the rate xi.

    Attributes (leaves of any batch shape):
        mu_static: static coefficient, reached at v0 [–].
        mu_kinetic: kinetic coefficient, reached far above v0 [–].
        v0: slip speed of the peak [m/s].
        xi: Stribeck rate, the decay above v0 [s/m].

    Raises:
        ArgumentError: a coefficient or xi is below 0, or v0 is not above 0.
    """

    builds_up_over: ClassVar[str | None] = "v0"
    mu_static: Parameter = parameter("static friction", r"$\mu_0$", minimum=0.0)
    mu_kinetic: Parameter = parameter("kinetic friction", r"$\mu$", minimum=0.0)
    v0: Parameter = parameter("slip at the peak", "$v_0$", "m/s", positive=True)
    xi: Parameter = parameter("decay of friction", r"$\xi$", "s/m", minimum=0.0)


class BengisuAkay(AbstractPeakedFriction):
    """Regularised dry friction that rises to its static peak at v0 and decays to kinetic.

    With F_S = mu_static F_N, F_C = mu_kinetic F_N and s = |V_T|:

    - s < v0: F = F_S − (F_S/v0²)(s − v0)²
    - s ≥ v0: F = F_C + (F_S − F_C) exp(−xi (s − v0))

    Source: the seed paper, section 2.2, after Bengisu and Akay. The printed first branch lacks a
    minus sign, a square and a bracket; only this reading is zero at rest and continuous at v0.
    """

    name: ClassVar[str] = "bengisu-akay"

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

    @classmethod
    def like_seed(cls, seed: Self) -> Self:
        """The seed's law."""
        return seed


class SmoothBengisuAkay(AbstractPeakedFriction):
    """`BengisuAkay` made twice continuously differentiable, with the same four parameters.

    With u = V_T/v0, F_S = mu_static F_N and F_C = mu_kinetic F_N:

    - |u| < 1: F = F_S (15 u − 10 u³ + 3 u⁵)/8, odd, with slope 15/8 at rest (the original's: 2)
    - |u| ≥ 1: F = F_C + (F_S − F_C) exp(−xi R(s − v0)), R a C² ramp from zero that equals its
      argument from v0 on.

    From 2 v0 on it is the original. `docs/laws.md` shows how much it changes the gait.
    """

    name: ClassVar[str] = "smooth-bengisu-akay"

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        u = jnp.clip(slip_speed / self.v0, -1.0, 1.0)
        rise = u * (1.875 + u * u * (0.375 * u * u - 1.25))
        beyond = smooth_ramp(jnp.abs(slip_speed) - self.v0, self.v0)
        decay = jnp.exp(-self.xi * beyond)
        level = self.mu_kinetic + (self.mu_static - self.mu_kinetic) * decay
        return -normal_force * rise * level

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """The seed's own parameters."""
        return cls(seed.mu_static, seed.mu_kinetic, seed.v0, seed.xi)

"""Friction with one coefficient or none: regularised dry friction, viscous, frictionless."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._checks import check_positive
from jaxbiped._jax_versions import tanh
from jaxbiped._parameter_declaration import check_parameters, parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._stribeck import BengisuAkay


class Frictionless(AbstractFrictionLaw):
    """No tangential force. The equations of motion contain no friction terms."""

    name: ClassVar[str] = "frictionless"

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        return jnp.zeros_like(normal_force)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """The law itself, which has no parameters to match the seed's."""
        return cls()


class Viscous(AbstractFrictionLaw):
    """F = k F_N V_T, opposing V_T. Smooth everywhere and unbounded.

    Unlike the viscous term of a lubricated joint, the force is proportional to the load, so it
    vanishes with contact: a foot without load has no friction.

    Attributes (leaves of any batch shape):
        k: friction per load and slip speed [s/m].

    Raises:
        ArgumentError: k is below 0.
    """

    name: ClassVar[str] = "viscous"
    k: Parameter = parameter("friction per slip", "$k$", "s/m", minimum=0.0)

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        return -self.k * normal_force * slip_speed

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """mu_static F_N at the seed's v0, and unbounded above it."""
        return cls(k=by_numpy(lambda _, mu, v0: mu / v0, seed.mu_static, seed.v0))


class RegularisedCoulomb(AbstractFrictionLaw):
    """F = mu F_N tanh(V_T / v_d), opposing V_T. Smooth everywhere, without a Stribeck peak.

    Attributes (leaves of any batch shape):
        mu: coefficient of friction [–].
        v_d: slip speed over which the force builds up [m/s].

    Raises:
        ArgumentError: mu is below 0, or v_d is not above 0.
    """

    name: ClassVar[str] = "coulomb"
    builds_up_over: ClassVar[str | None] = "v_d"
    mu: Parameter = parameter("friction coefficient", r"$\mu$", minimum=0.0)
    v_d: Parameter = parameter("build-up speed", "$v_d$", "m/s", positive=True)

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        return -self.mu * normal_force * tanh(slip_speed / self.v_d)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """The kinetic coefficient, and the slope 2 mu/v0 at rest: v_d = v0/2."""
        return cls(mu=seed.mu_kinetic, v_d=by_numpy(lambda _, v0: 0.5 * v0, seed.v0))


class Threlfall(AbstractFrictionLaw):
    """Dry friction that builds up exponentially up to v0 and is constant above.

    With F_C = mu F_N and s = |V_T|:

    - s ≤ v0: F = F_C (1 − exp(−3 s/v0))
    - s > v0: F = F_C (1 − e⁻³), about 0.95 F_C

    Source: Threlfall, Mechanism and Machine Theory 13 (1978) 475. Publications differ above v0:
    some use F_C. This is the continuous reading.

    Attributes (leaves of any batch shape):
        mu: coefficient of friction; a twentieth more than the largest share of the load reached
            [–].
        v0: slip speed above which the force is constant [m/s].

    Raises:
        ArgumentError: mu is below 0, or v0 is not above 0.
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
        """The kinetic coefficient, with the slope 3 mu/v0 at rest, constant above v0."""
        return cls(mu=seed.mu_kinetic, v0=seed.v0)


class Ambrosio(AbstractFrictionLaw):
    """Dry friction that starts at v0, rises linearly to v1 and is constant above.

    With F_C = mu F_N and s = |V_T|:

    - s ≤ v0: F = 0
    - v0 < s < v1: F = F_C (s − v0)/(v1 − v0)
    - s ≥ v1: F = F_C

    A foot that slips more slowly than v0 slips freely.

    Source: Ambrósio, in Virtual Nonlinear Multibody Systems, NATO Science Series (2003) 57.

    Attributes (leaves of any batch shape):
        mu: coefficient of friction [–].
        v0: slip speed up to which there is no friction [m/s].
        v1: slip speed above which the force is constant [m/s].

    Raises:
        ArgumentError: mu is below 0, v0 is not above 0, or v1 is not above v0.
    """

    name: ClassVar[str] = "ambrosio"
    builds_up_over: ClassVar[str | None] = "v1"
    mu: Parameter = parameter("friction coefficient", r"$\mu$", minimum=0.0)
    v0: Parameter = parameter("slip at onset", "$v_0$", "m/s", positive=True)
    v1: Parameter = parameter("slip of full friction", "$v_1$", "m/s", positive=True)

    def __check_init__(self) -> None:
        check_parameters(self)
        check_positive("v1 − v0", by_numpy(lambda _, v1, v0: v1 - v0, self.v1, self.v0), "m/s")

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        part = jnp.clip((jnp.abs(slip_speed) - self.v0) / (self.v1 - self.v0), 0.0, 1.0)
        return -self.mu * normal_force * jnp.sign(slip_speed) * part

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        bounds = (self.v0, self.v1)
        return (*(slip_speed - v for v in bounds), *(slip_speed + v for v in bounds))

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """The kinetic coefficient, reached from v0/2 to v0 with the slope 2 mu/v0."""
        return cls(mu=seed.mu_kinetic, v0=by_numpy(lambda _, v0: 0.5 * v0, seed.v0), v1=seed.v0)

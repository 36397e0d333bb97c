"""Friction with a Stribeck peak: it falls from static to kinetic as the slip grows; the seed's."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._checks import ArgumentError, check_at_least, check_positive, holds_somewhere
from jaxbiped._jax_versions import tanh
from jaxbiped._parameter_declaration import check_parameters, parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw, power, smooth_ramp


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


class AbstractStribeckCurve(AbstractFrictionLaw):
    """Friction with the coefficient μ = mu_kinetic + (mu_static − mu_kinetic) exp(−(|V_T|/v_s)^p).

    At rest, the second derivative jumps for p = 1 and is unbounded for p < 1; for p > 1, the law
    has no switch.

    Attributes (leaves of any batch shape):
        mu_static: static coefficient, from which the curve starts [–].
        mu_kinetic: kinetic coefficient, to which the curve falls [–].
        v_s: Stribeck speed, over which the curve falls [m/s].
        p: exponent of the fall, usually from 0.5 to 2 [–].
    """

    mu_static: Parameter = parameter("static friction", r"$\mu_0$", minimum=0.0)
    mu_kinetic: Parameter = parameter("kinetic friction", r"$\mu$", minimum=0.0)
    v_s: Parameter = parameter("Stribeck speed", "$v_s$", "m/s", positive=True)
    p: Parameter = parameter("exponent of the fall", "$p$", positive=True)

    def coefficient(self, slip_speed: Scalar) -> Scalar:
        """μ [–], even in V_T and equal to mu_static at rest.

        Its slope at rest is reported as zero, although for p < 1 there is none: μ is multiplied by
        a factor that vanishes there.
        """
        speed = jnp.abs(slip_speed)
        slips = speed > 0.0
        fallen = power(jnp.where(slips, speed, self.v_s) / self.v_s, self.p)
        decay = jnp.where(slips, jnp.exp(-fallen), 1.0)
        return self.mu_kinetic + (self.mu_static - self.mu_kinetic) * decay

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        """Rest for p ≤ 1; for a larger p, a function without a zero."""
        return (jnp.where(self.p <= 1.0, slip_speed, 1.0),)

    @staticmethod
    def curve_like_seed(seed: BengisuAkay) -> dict[str, Parameter]:
        """Both coefficients and the fall over 1/xi (p = 1)."""
        check_positive("xi", seed.xi, "s/m")
        v_s = by_numpy(lambda _, xi: 1.0 / xi, seed.xi)
        return dict(mu_static=seed.mu_static, mu_kinetic=seed.mu_kinetic, v_s=v_s, p=1.0)


class Stribeck(AbstractStribeckCurve):
    """Friction that falls from static to kinetic and rises again with the speed of slip.

    F = F_N (μ tanh(V_T/v_d) + k_v V_T), opposing V_T, with the curve μ of `AbstractStribeckCurve`
    and its parameters.

    The tanh regularises rest. If v_d is well below v_s (p = 2), the peak lies at a few v_d and
    nearly reaches mu_static. The viscous part is proportional to the load, so it vanishes with
    contact.

    Source: Bo and Pavelescu, Wear 82 (1982) 277; Armstrong-Hélouvry, Dupont and Canudas de Wit,
    Automatica 30 (1994) 1083.

    Attributes (leaves of any batch shape):
        k_v: viscous friction per load and slip speed [s/m].
        v_d: slip speed over which friction builds up from rest [m/s].

    Raises:
        ArgumentError: a coefficient or k_v is below 0, or v_s, p or v_d is not above 0.
    """

    name: ClassVar[str] = "stribeck"
    builds_up_over: ClassVar[str | None] = "v_d"
    k_v: Parameter = parameter("viscous friction", "$k_v$", "s/m", minimum=0.0)
    v_d: Parameter = parameter("build-up speed", "$v_d$", "m/s", positive=True)

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        dry = self.coefficient(slip_speed) * tanh(slip_speed / self.v_d)
        return -normal_force * (dry + self.k_v * slip_speed)

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """Both coefficients, the slope 2 mu/v0 at rest (v_d = v0/2), the fall over 1/xi (p = 1)."""
        v_d = by_numpy(lambda _, v0: 0.5 * v0, seed.v0)
        return cls(**cls.curve_like_seed(seed), k_v=0.0, v_d=v_d)


class Andersson(AbstractStribeckCurve):
    """F = F_N μ tanh(k V_T), opposing V_T: a Stribeck curve, regularised at rest.

    The curve μ and its parameters are those of `AbstractStribeckCurve`.

    Source: Andersson, Söderberg and Björklund, Tribology International 40 (2007) 580.

    Attributes (leaves of any batch shape):
        k: sharpness with which friction builds up from rest [s/m].

    Raises:
        ArgumentError: a coefficient is below 0, or v_s, p or k is not above 0.
    """

    name: ClassVar[str] = "andersson"
    k: Parameter = parameter("friction per slip", "$k$", "s/m", positive=True)

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        return -normal_force * self.coefficient(slip_speed) * tanh(self.k * slip_speed)

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """Both coefficients, the slope 2 mu/v0 at rest (k = 2/v0), the fall over 1/xi (p = 1)."""
        return cls(**cls.curve_like_seed(seed), k=by_numpy(lambda _, v0: 2.0 / v0, seed.v0))


class BrownMcPhee(AbstractFrictionLaw):
    """Friction with a Stribeck peak at v_t from one smooth expression.

    F = F_N (mu_dynamic tanh(4u) + (mu_static − mu_dynamic) u/(¼u² + ¾)²)
    + mu_v V_T tanh(4 F_N/N_t), opposing V_T, with u = V_T/v_t.

    The peak at v_t is mu_static F_N, except that the tanh lacks 0.07 per cent of mu_dynamic there.
    The law was published as continuously differentiable; written in the signed u, it is smooth.
    The viscous part is not proportional to the load; it vanishes below N_t.

    Source: Brown and McPhee, Journal of Computational and Nonlinear Dynamics 11 (2016) 054502.

    Attributes (leaves of any batch shape):
        mu_static: static coefficient, reached at v_t; at least mu_dynamic, because with a
            coefficient far below it friction would push the foot along [–].
        mu_dynamic: dynamic coefficient, reached far above v_t [–].
        v_t: slip speed of the peak [m/s].
        mu_v: viscous coefficient [N·s/m].
        N_t: load above which the viscous part acts in full [N]. None: there is no viscous part,
            and the compiled program does not contain it.

    Raises:
        ArgumentError: mu_dynamic or mu_v is below 0, mu_static is below mu_dynamic, v_t or N_t is
            not above 0, or mu_v is above 0 without N_t.
    """

    name: ClassVar[str] = "brown-mcphee"
    builds_up_over: ClassVar[str | None] = "v_t"
    mu_static: Parameter = parameter("static friction", r"$\mu_0$")
    mu_dynamic: Parameter = parameter("kinetic friction", r"$\mu$", minimum=0.0)
    v_t: Parameter = parameter("slip at the peak", "$v_t$", "m/s", positive=True)
    mu_v: Parameter = parameter("viscous friction", r"$\mu_v$", "N s/m", minimum=0.0, default=0.0)
    N_t: Parameter | None = parameter(
        "load of full viscosity", "$N_t$", "N", positive=True, default=None
    )

    def __check_init__(self) -> None:
        check_parameters(self)
        check_at_least("mu_static", self.mu_static, "mu_dynamic", self.mu_dynamic)
        if self.N_t is None and holds_somewhere(by_numpy(lambda _, mu: mu > 0.0, self.mu_v)):
            raise ArgumentError("N_t = None is not allowed where mu_v is above 0: give a load [N].")

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        u = slip_speed / self.v_t
        well = 0.25 * u * u + 0.75
        peak = (self.mu_static - self.mu_dynamic) * u / (well * well)
        dry = normal_force * (self.mu_dynamic * tanh(4.0 * u) + peak)
        if self.N_t is None:
            return -dry
        return -dry - self.mu_v * slip_speed * tanh(4.0 * normal_force / self.N_t)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """Both coefficients, the peak at v0 and a fall over a few v0; no viscous part."""
        return cls(seed.mu_static, seed.mu_kinetic, seed.v0)

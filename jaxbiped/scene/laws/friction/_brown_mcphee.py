"""Brown and McPhee's friction law."""

from typing import ClassVar, Self

from jaxbiped._checks import (
    ArgumentError,
    check_at_least,
    holds_somewhere,
)
from jaxbiped._jax_versions import tanh
from jaxbiped._parameter import check_parameters, parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay


class BrownMcPhee(AbstractFrictionLaw):
    """Friction with a Stribeck peak at v_t from one smooth expression.

    F = F_N (mu_dynamic tanh(4u) + (mu_static − mu_dynamic) u/(¼u² + ¾)²)
    + mu_v V_T tanh(4 F_N/N_t), opposing V_T, with u = V_T/v_t.

    The peak at v_t is mu_static F_N but for the tanh, which lacks 0.07 per cent of mu_dynamic
    there. Published as continuously differentiable; written in the signed u it is smooth.
    The viscous part is not proportional to the load; it fades below N_t.

    Source: Brown and McPhee, Journal of Computational and Nonlinear Dynamics 11 (2016) 054502.

    Attributes (leaves of any batch shape):
        mu_static: static coefficient, reached at v_t; at least mu_dynamic, for one far below it
            would make the friction push the foot along [–].
        mu_dynamic: dynamic coefficient, reached far above v_t [–].
        v_t: slip speed of the peak [m/s].
        mu_v: viscous coefficient [N·s/m].
        N_t: load from which the viscous part acts in full [N]. None: there is no viscous part,
            and nothing of it in the compiled program.

    Raises:
        ArgumentError: mu_dynamic or mu_v below 0, mu_static below mu_dynamic, v_t or N_t not
            above 0, or a mu_v above 0 without N_t.
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

"""Ambrósio's friction law."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._checks import check_positive
from jaxbiped._parameter import check_parameters, parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay


class Ambrosio(AbstractFrictionLaw):
    """Dry friction that sets in at v0, rises in proportion and is held from v1 on.

    With F_C = mu F_N and s = |V_T|:

    - s ≤ v0: F = 0
    - v0 < s < v1: F = F_C (s − v0)/(v1 − v0)
    - s ≥ v1: F = F_C

    A foot that slips more slowly than v0 slips freely.

    Source: Ambrósio, in Virtual Nonlinear Multibody Systems, NATO Science Series (2003) 57.

    Attributes (leaves of any batch shape):
        mu: coefficient of friction [–].
        v0: slip speed up to which there is no friction [m/s].
        v1: slip speed from which there is all of it [m/s].

    Raises:
        ArgumentError: mu below 0, v0 not above 0 or v1 not above v0.
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
        """The kinetic coefficient, from v0/2 to v0 with the slope 2 mu/v0."""
        return cls(mu=seed.mu_kinetic, v0=by_numpy(lambda _, v0: 0.5 * v0, seed.v0), v1=seed.v0)

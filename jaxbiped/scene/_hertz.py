"""Hertz's law of elastic contact."""

import equinox as eqx

from jaxbiped._checks import check_at_least, check_positive
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene._law import AbstractNormalLaw, hertz_energy, hertz_force


class Hertz(AbstractNormalLaw):
    """F_N = K δⁿ while δ > 0: elastic, without damping.

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/mⁿ].
        n: exponent [–].

    Raises:
        ArgumentError: K not above 0 or n below 1.
    """

    K: Parameter = eqx.field(converter=as_float)
    n: Parameter = eqx.field(converter=as_float, default=1.5)

    def __check_init__(self) -> None:
        check_positive("K", self.K, "N/m^n")
        check_at_least("n", self.n, "1", 1.0)

    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        return self.elastic_force(penetration)

    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        return ()

    def elastic_force(self, penetration: Scalar) -> Scalar:
        return hertz_force(self.K, self.n, penetration)

    def elastic_energy(self, penetration: Scalar) -> Scalar:
        return hertz_energy(self.K, self.n, penetration)

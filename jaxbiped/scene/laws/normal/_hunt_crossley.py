"""Hunt and Crossley's law, and its damping factor χ from restitution by eight formulas.

None of them yields its e exactly over the whole range: the two oldest and that of Lankarani and
Nikravesh hold near e = 1, the later ones also for soft impacts. The restitution of each is listed
in tests/scene/laws/test_restitution.py.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import ClassVar, NamedTuple, Self

import jax.numpy as jnp

from jaxbiped._checks import check_choice, check_positive, check_within
from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene.laws._abstract_laws import AbstractHertzianLaw, depth_in_contact, power, pushing
from jaxbiped.scene.laws.normal._ristow_schafer import RistowSchafer, Standing


class Restitution(NamedTuple):
    """A formula for the factor χ [–] of a coefficient of restitution e [–].

    Attributes:
        formula: χ of e.
        divides: whether it divides by e, which is then not 0.
    """

    formula: Callable[[Scalar], Scalar]
    divides: bool = False

    def __call__(self, e: Parameter) -> Scalar:
        """χ; raises `ArgumentError` unless e lies in [0, 1], above 0 where it divides."""
        e = as_float(e)
        check_within("e", e, 0.0, 1.0, open_below=self.divides)
        return self.formula(e)


RESTITUTION_FORMULAS: Mapping[str, Restitution] = MappingProxyType(
    {
        "hunt-crossley": Restitution(lambda e: 1.5 * (1.0 - e)),
        "herbert-mcwhannell": Restitution(lambda e: 6.0 * (1.0 - e) / ((2.0 * e - 1.0) ** 2 + 3.0)),
        "lee-wang": Restitution(lambda e: 0.75 * (1.0 - e)),
        "lankarani-nikravesh": Restitution(lambda e: 0.75 * (1.0 - e * e)),
        "gonthier": Restitution(lambda e: (1.0 - e * e) / e, divides=True),
        "zhiying-qishao": Restitution(lambda e: 0.75 * (1.0 - e * e) * jnp.exp(2.0 * (1.0 - e))),
        "flores": Restitution(lambda e: 1.6 * (1.0 - e) / e, divides=True),
        "hu-guo": Restitution(lambda e: 1.5 * (1.0 - e) / e, divides=True),
    }
)
"""Each formula's name and its function: coefficient of restitution e [–] to factor χ [–].

- hunt-crossley: Hunt and Crossley, Journal of Applied Mechanics 42 (1975) 440.
- herbert-mcwhannell: Herbert and McWhannell, Journal of Engineering for Industry 99 (1977) 792.
- lee-wang: Lee and Wang, Journal of Vibration, Acoustics, Stress and Reliability in Design 105
  (1983) 534.
- lankarani-nikravesh: Lankarani and Nikravesh, Journal of Mechanical Design 112 (1990) 369.
- gonthier: Gonthier, McPhee, Lange and Piedbœuf, Multibody System Dynamics 11 (2004) 209: the first
  approximation of an implicit equation.
- zhiying-qishao: Zhang Zhiying and Lu Qishao, Journal of Dynamics and Control 4 (2006) 294.
- flores: Flores, Machado, Silva and Martins, Multibody System Dynamics 25 (2011) 357.
- hu-guo: Hu and Guo, Multibody System Dynamics 35 (2015) 131.
"""


class HuntCrossley(AbstractHertzianLaw):
    """F_N = K δⁿ (1 + hysteresis δ̇) while δ > 0, never below zero (no adhesion).

    The literature writes χ/v⁻ for the hysteresis, with a factor χ that depends on the restitution
    and the approach speed v⁻. In a walker, v⁻ is a state of the contact and not a constant, so the
    parameter here is the quotient; `from_restitution` computes it from both. The reaction reaches
    zero at δ̇ = −1/hysteresis; a foot that is not pulled out never moves so fast.

    Source: Hunt and Crossley, Journal of Applied Mechanics 42 (1975) 440.

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/mⁿ].
        hysteresis: damping over stiffness, χ/v⁻ [s/m].
        n: exponent [–].

    Raises:
        ArgumentError: K is not above 0, hysteresis is below 0, or n is below 1.
    """

    name: ClassVar[str] = "hunt-crossley"
    K: Parameter = parameter("contact stiffness", "$K$", "N/m^n", positive=True)
    hysteresis: Parameter = parameter("hysteresis", r"$\chi/v^-$", "s/m", minimum=0.0)
    n: Parameter = parameter("contact exponent", "$n$", minimum=1.0, default=1.5)

    @classmethod
    def from_restitution(
        cls,
        *,
        K: Parameter,
        e: Parameter,
        approach_speed: Parameter,
        formula: str = "flores",
        n: Parameter = 1.5,
    ) -> Self:
        """The law that approximates the restitution `e` of an impact at `approach_speed`.

        How close the restitution of such an impact is to e depends on the formula: for e = 0.5, it
        ranges from 0.47 (Flores) to 0.80 (Lee and Wang).

        Args:
            K: contact stiffness [N/mⁿ].
            e: coefficient of restitution [–], up to 1; above 0 for a formula that divides by it.
            approach_speed: rate of penetration at touchdown, v⁻ [m/s].
            formula: one of `RESTITUTION_FORMULAS`.
            n: exponent [–].

        Raises:
            ArgumentError: the formula is unknown or does not allow e, K or approach_speed is not
                above 0, or n is below 1.
        """
        check_choice("formula", formula, RESTITUTION_FORMULAS)
        speed = as_float(approach_speed)
        check_positive("approach_speed", speed, "m/s")
        return cls(K=K, hysteresis=RESTITUTION_FORMULAS[formula](e) / speed, n=n)

    @staticmethod
    def damping_coefficient(damper: Scalar, penetration: Scalar, weight: Scalar) -> Scalar:
        return damper / weight

    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        depth = depth_in_contact(penetration)
        return pushing(penetration, self.K * power(depth, self.n) * (1.0 + self.hysteresis * rate))

    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        """The reaction divided by K δⁿ."""
        return (1.0 + self.hysteresis * rate,)

    @classmethod
    def like_seed(cls, seed: RistowSchafer, standing: Standing) -> Self:
        """The seed's exponent, penetration under the weight and damping ratio about it."""
        return cls.from_weight(**standing.arguments(), n=seed.n)

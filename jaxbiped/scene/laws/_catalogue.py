"""Catalogue of the laws of contact by name, each made to resemble the seed's."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._checks import check_choice, check_positive
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw, AbstractNormalLaw
from jaxbiped.scene.laws.bristles._bristle_law import AbstractBristleLaw
from jaxbiped.scene.laws.bristles._dahl import Dahl
from jaxbiped.scene.laws.bristles._lugre import LuGre
from jaxbiped.scene.laws.friction._ambrosio import Ambrosio
from jaxbiped.scene.laws.friction._andersson import Andersson
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay
from jaxbiped.scene.laws.friction._brown_mcphee import BrownMcPhee
from jaxbiped.scene.laws.friction._coulomb import RegularisedCoulomb
from jaxbiped.scene.laws.friction._frictionless import Frictionless
from jaxbiped.scene.laws.friction._smooth_bengisu_akay import SmoothBengisuAkay
from jaxbiped.scene.laws.friction._stribeck import Stribeck
from jaxbiped.scene.laws.friction._threlfall import Threlfall
from jaxbiped.scene.laws.friction._viscous import Viscous
from jaxbiped.scene.laws.normal._hertz import Hertz
from jaxbiped.scene.laws.normal._hunt_crossley import HuntCrossley
from jaxbiped.scene.laws.normal._kelvin_voigt import KelvinVoigt
from jaxbiped.scene.laws.normal._kuwabara_kono import KuwabaraKono
from jaxbiped.scene.laws.normal._ristow_schafer import RistowSchafer
from jaxbiped.scene.laws.normal._smooth_ristow_schafer import SmoothRistowSchafer
from jaxbiped.scene.laws.normal._tsuji import Tsuji

NORMAL_LAWS: Mapping[str, type[AbstractNormalLaw]] = MappingProxyType(
    {
        "hertz": Hertz,
        "kelvin-voigt": KelvinVoigt,
        "ristow-schafer": RistowSchafer,
        "smooth-ristow-schafer": SmoothRistowSchafer,
        "kuwabara-kono": KuwabaraKono,
        "tsuji": Tsuji,
        "hunt-crossley": HuntCrossley,
    }
)
"""Each law of the normal force by name."""

FRICTION_LAWS: Mapping[str, type[AbstractFrictionLaw | AbstractBristleLaw]] = MappingProxyType(
    {
        "frictionless": Frictionless,
        "viscous": Viscous,
        "coulomb": RegularisedCoulomb,
        "threlfall": Threlfall,
        "ambrosio": Ambrosio,
        "stribeck": Stribeck,
        "bengisu-akay": BengisuAkay,
        "smooth-bengisu-akay": SmoothBengisuAkay,
        "andersson": Andersson,
        "brown-mcphee": BrownMcPhee,
        "dahl": Dahl,
        "lugre": LuGre,
    }
)
"""Each law of the tangential force by name. Those with bristles have states of their own."""

_LUGRE_GIVE = 1e-5
"""How far LuGre's bristles bend before they slip [m]."""
_DAHL_GIVE = 4e-4
"""How far Dahl's bristles bend before they slip [m]: see `friction_law_like`."""
_MASS_PER_LOAD = 0.05
"""What LuGre's bristles hold in place for each newton of load [kg/N]: 1 kg under 20 N."""


def normal_law_like(
    name: str,
    *,
    K: Parameter,
    c: Parameter,
    n: Parameter,
    mass: Parameter,
    g: Parameter = 9.8,
) -> AbstractNormalLaw:
    """The normal law of a name that carries a mass as `RistowSchafer(K, c, n)` does.

    The seed's law and its smooth counterpart have exactly these K, c and n. Every other stands
    at the same penetration under the weight, with the same damping ratio of small oscillations
    about it; Hertz's with the same penetration. Where a law has an exponent of its own to choose,
    it is n; the others keep theirs, so their linear stiffness there differs from the seed's by
    the quotient of the exponents, and their linear damper by its root.

    Args:
        name: one of `NORMAL_LAWS`.
        K: the seed law's contact stiffness [N/mⁿ].
        c: the seed law's contact damping [N·s/m²].
        n: the seed law's exponent [–].
        mass: what stands on the law [kg].
        g: gravitational acceleration [m/s²].

    Returns:
        The law, its parameters in SI units.

    Raises:
        ArgumentError: an unknown name, or a value that is not allowed.
    """
    check_choice("name", name, NORMAL_LAWS)
    seed = RistowSchafer(K=K, c=c, n=n)
    return _NORMAL_LIKE[name](seed, _standing(seed, as_float(mass), as_float(g)))


class _Standing(NamedTuple):
    """How a mass stands on a law: the arguments of `from_weight`."""

    mass: Scalar
    penetration: Scalar
    damping_ratio: Scalar
    g: Scalar


def _standing(law: RistowSchafer, mass: Scalar, g: Scalar) -> _Standing:
    check_positive("mass", mass, "kg")
    check_positive("g", g, "m/s^2")
    penetration = (mass * g / law.K) ** (1.0 / law.n)
    stiffness = law.n * mass * g / penetration
    damping_ratio = 0.5 * law.c * penetration / jnp.sqrt(stiffness * mass)
    return _Standing(mass, penetration, damping_ratio, g)


_NORMAL_LIKE: Mapping[str, Callable[[RistowSchafer, _Standing], AbstractNormalLaw]] = {
    "hertz": lambda seed, at: Hertz.from_weight(
        mass=at.mass, penetration=at.penetration, g=at.g, n=seed.n
    ),
    "kelvin-voigt": lambda seed, at: KelvinVoigt.from_weight(**at._asdict()),
    "ristow-schafer": lambda seed, at: seed,
    "smooth-ristow-schafer": lambda seed, at: SmoothRistowSchafer(K=seed.K, c=seed.c, n=seed.n),
    "kuwabara-kono": lambda seed, at: KuwabaraKono.from_weight(**at._asdict()),
    "tsuji": lambda seed, at: Tsuji.from_weight(**at._asdict()),
    "hunt-crossley": lambda seed, at: HuntCrossley.from_weight(**at._asdict(), n=seed.n),
}


def friction_law_like(
    name: str, *, mu_static: Parameter, mu_kinetic: Parameter, v0: Parameter, xi: Parameter
) -> AbstractFrictionLaw | AbstractBristleLaw:
    """The friction law of a name that resembles `BengisuAkay` with these parameters.

    The seed's law rises from rest with the slope 2 mu_static/v0, peaks at v0 and falls to
    mu_kinetic over 1/xi beyond. The others follow it in what they have:

    | name                | coefficients          | near rest                       | fall        |
    |---------------------|-----------------------|---------------------------------|-------------|
    | frictionless        | none                  | none                            | none        |
    | viscous             | k = mu_static/v0      | mu_static F_N at v0, unbounded  | none        |
    | coulomb             | mu = mu_kinetic       | v_d = v0/2: slope 2 mu/v0       | none        |
    | threlfall           | mu = mu_kinetic       | v0: slope 3 mu/v0, held from v0 | none        |
    | ambrosio            | mu = mu_kinetic       | from v0/2 to v0: slope 2 mu/v0  | none        |
    | stribeck            | both; k_v = 0         | v_d = v0/2: slope 2 mu/v0       | 1/xi, p = 1 |
    | bengisu-akay        | both                  | v0                              | xi          |
    | smooth-bengisu-akay | both                  | v0                              | xi          |
    | andersson           | both                  | k = 2/v0: slope 2 mu/v0         | 1/xi, p = 1 |
    | brown-mcphee        | both; no viscous part | v_t = v0: peak at v0            | a few v0    |
    | dahl                | mu = mu_kinetic       | bristles give 4e-4 m            | none        |
    | lugre               | both; sigma_2 = 0     | bristles give 1e-5 m            | 1/xi, p = 2 |

    Laws with one coefficient take the kinetic one, which most of a slide sees. The bristles of
    dahl and lugre give by so much, mu/sigma_0 with the first of the coefficients, before they
    slip. LuGre's damping sigma_1 is critical for 1 kg that carries 20 N. Dahl's bristles have no
    damping and ring, faster and longer the stiffer they are: so soft, the seed's walk takes
    nearly five times as many steps as with the seed's law, and `find_gait` finds its gait. With
    less than about 2e-4 m it does so by accuracy="tight" only.

    Args:
        name: one of `FRICTION_LAWS`.
        mu_static: the seed law's static coefficient [–].
        mu_kinetic: the seed law's kinetic coefficient [–].
        v0: the seed law's slip speed of the peak [m/s].
        xi: the seed law's Stribeck rate [s/m]; above 0 for a law that falls over 1/xi.

    Returns:
        The law, its parameters in SI units.

    Raises:
        ArgumentError: an unknown name, or a value that is not allowed.

    Examples:
        >>> import jaxbiped as jb
        >>> law = jb.laws.friction_law_like(
        ...     "coulomb", mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0
        ... )
        >>> float(law.mu), float(law.v_d)
        (0.4, 5e-05)
    """
    check_choice("name", name, FRICTION_LAWS)
    return _FRICTION_LIKE[name](BengisuAkay(mu_static, mu_kinetic, v0, xi))


def _viscous(seed: BengisuAkay) -> Viscous:
    return Viscous(k=seed.mu_static / seed.v0)


def _coulomb(seed: BengisuAkay) -> RegularisedCoulomb:
    return RegularisedCoulomb(mu=seed.mu_kinetic, v_d=0.5 * seed.v0)


def _ambrosio(seed: BengisuAkay) -> Ambrosio:
    return Ambrosio(mu=seed.mu_kinetic, v0=0.5 * seed.v0, v1=seed.v0)


def _stribeck(seed: BengisuAkay) -> Stribeck:
    check_positive("xi", seed.xi, "s/m")
    return Stribeck(
        mu_static=seed.mu_static,
        mu_kinetic=seed.mu_kinetic,
        v_s=1.0 / seed.xi,
        p=1.0,
        k_v=0.0,
        v_d=0.5 * seed.v0,
    )


def _andersson(seed: BengisuAkay) -> Andersson:
    check_positive("xi", seed.xi, "s/m")
    return Andersson(
        mu_static=seed.mu_static,
        mu_kinetic=seed.mu_kinetic,
        v_s=1.0 / seed.xi,
        p=1.0,
        k=2.0 / seed.v0,
    )


def _lugre(seed: BengisuAkay) -> LuGre:
    check_positive("xi", seed.xi, "s/m")
    sigma_0 = seed.mu_static / _LUGRE_GIVE
    return LuGre(
        mu_static=seed.mu_static,
        mu_kinetic=seed.mu_kinetic,
        v_s=1.0 / seed.xi,
        sigma_0=sigma_0,
        sigma_1=2.0 * jnp.sqrt(sigma_0 * _MASS_PER_LOAD),
    )


_FRICTION_LIKE: Mapping[str, Callable[[BengisuAkay], AbstractFrictionLaw | AbstractBristleLaw]] = {
    "frictionless": lambda seed: Frictionless(),
    "viscous": _viscous,
    "coulomb": _coulomb,
    "threlfall": lambda seed: Threlfall(mu=seed.mu_kinetic, v0=seed.v0),
    "ambrosio": _ambrosio,
    "stribeck": _stribeck,
    "bengisu-akay": lambda seed: seed,
    "smooth-bengisu-akay": lambda seed: SmoothBengisuAkay(
        seed.mu_static, seed.mu_kinetic, seed.v0, seed.xi
    ),
    "andersson": _andersson,
    "brown-mcphee": lambda seed: BrownMcPhee(seed.mu_static, seed.mu_kinetic, seed.v0),
    "dahl": lambda seed: Dahl(mu=seed.mu_kinetic, sigma_0=seed.mu_kinetic / _DAHL_GIVE),
    "lugre": _lugre,
}

"""Catalogue of the laws of contact by name, each made to resemble the seed's."""

from typing import Any, cast

from jaxbiped._checks import check_choice, check_positive
from jaxbiped._types import Parameter, as_float
from jaxbiped.scene import laws
from jaxbiped.scene.laws._abstract_laws import (
    FRICTION_LAWS,
    NORMAL_LAWS,
    AbstractNormalLaw,
)
from jaxbiped.scene.laws.friction._stribeck import BengisuAkay
from jaxbiped.scene.laws.normal._ristow_schafer import RistowSchafer, Standing

_CATALOGUES: tuple[dict[str, Any], ...] = (NORMAL_LAWS, FRICTION_LAWS)
for _law in list(vars(laws).values()):
    # In the order of the lines that export them, not of the modules that define them.
    for _known in _CATALOGUES:
        if _law in _known.values():
            _known[_law.name] = _known.pop(_law.name)


def normal_law_like(
    name: str,
    *,
    K: Parameter = 1e6,
    c: Parameter = 1e7,
    n: Parameter = 1.5,
    mass: Parameter = 2.0,
    g: Parameter = 9.8,
) -> AbstractNormalLaw:
    """The named normal law that carries a mass as `RistowSchafer(K, c, n)` does.

    The seed's law and its smooth counterpart have exactly these K, c and n. Every other law has the
    same penetration under the weight and the same damping ratio of small oscillations about it;
    Hertz's has the same penetration. A law whose exponent can be chosen has the exponent n. The
    others keep theirs, so their linear stiffness at that penetration differs from the seed's by the
    quotient of the exponents, and their linear damper by its root. Default of each parameter: the
    seed's value.

    Args:
        name: one of `NORMAL_LAWS`.
        K: the seed law's contact stiffness [N/mⁿ].
        c: the seed law's contact damping [N·s/m²].
        n: the seed law's exponent [–].
        mass: mass that stands on the law [kg].
        g: gravitational acceleration [m/s²].

    Returns:
        The law, its parameters in SI units.

    Raises:
        ArgumentError: the name is unknown, or a value is not allowed.
    """
    check_choice("name", name, NORMAL_LAWS)
    seed, law = RistowSchafer(K=K, c=c, n=n), cast("Any", NORMAL_LAWS[name])
    standing = Standing(seed, as_float(mass), as_float(g))
    check_positive("mass", standing.mass, "kg")
    check_positive("g", standing.g, "m/s^2")
    return law.like_seed(seed, standing)


def friction_law_like(
    name: str,
    *,
    mu_static: Parameter = 0.5,
    mu_kinetic: Parameter = 0.4,
    v0: Parameter = 1e-4,
    xi: Parameter = 1000.0,
) -> Any:
    """The named friction law that resembles `BengisuAkay` with these parameters.

    The seed's law rises from rest with the slope 2 mu_static/v0, peaks at v0 and then falls to
    mu_kinetic over 1/xi. The others share these features as far as they have them; `like_seed` of
    each law states which. Laws with one coefficient use the kinetic one, which applies during most
    of a slide. Default of each parameter: the seed's value.

    Args:
        name: one of `FRICTION_LAWS`.
        mu_static: the seed law's static coefficient [–].
        mu_kinetic: the seed law's kinetic coefficient [–].
        v0: the seed law's slip speed of the peak [m/s].
        xi: the seed law's Stribeck rate [s/m]; above 0 for a law that falls over 1/xi.

    Returns:
        The law, its parameters in SI units.

    Raises:
        ArgumentError: the name is unknown, or a value is not allowed.

    Examples:
        >>> import jaxbiped as jb
        >>> law = jb.laws.friction_law_like(
        ...     "coulomb", mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0
        ... )
        >>> float(law.mu), float(law.v_d)
        (0.4, 5e-05)
    """
    check_choice("name", name, FRICTION_LAWS)
    law = cast("Any", FRICTION_LAWS[name])
    return law.like_seed(BengisuAkay(mu_static, mu_kinetic, v0, xi))

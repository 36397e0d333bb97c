"""Restitution formulas: the damping factor χ of K δⁿ (1 + χ δ̇/v⁻), eight of them.

None realises its e exactly over the whole range: the two oldest and Lankarani and Nikravesh's hold
near e = 1, the later ones also for soft impacts. tests/scene/test_restitution.py tells what each
gives.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import jax.numpy as jnp

from jaxbiped._checks import check_within
from jaxbiped._types import Parameter, Scalar, as_float


def hunt_crossley(e: Parameter) -> Scalar:
    """3(1 − e)/2, for e in [0, 1].

    Source: Hunt and Crossley, Journal of Applied Mechanics 42 (1975) 440.
    """
    return 1.5 * (1.0 - _restitution(e))


def herbert_mcwhannell(e: Parameter) -> Scalar:
    """6(1 − e)/((2e − 1)² + 3), for e in [0, 1].

    Source: Herbert and McWhannell, Journal of Engineering for Industry 99 (1977) 792.
    """
    e = _restitution(e)
    return 6.0 * (1.0 - e) / ((2.0 * e - 1.0) ** 2 + 3.0)


def lee_wang(e: Parameter) -> Scalar:
    """3(1 − e)/4, for e in [0, 1].

    Source: Lee and Wang, Journal of Vibration, Acoustics, Stress and Reliability in Design 105
    (1983) 534.
    """
    return 0.75 * (1.0 - _restitution(e))


def lankarani_nikravesh(e: Parameter) -> Scalar:
    """3(1 − e²)/4, for e in [0, 1].

    Source: Lankarani and Nikravesh, Journal of Mechanical Design 112 (1990) 369.
    """
    e = _restitution(e)
    return 0.75 * (1.0 - e * e)


def gonthier(e: Parameter) -> Scalar:
    """(1 − e²)/e, for e in (0, 1]: the first approximation of an implicit equation.

    Source: Gonthier, McPhee, Lange and Piedbœuf, Multibody System Dynamics 11 (2004) 209.
    """
    e = _restitution(e, divides=True)
    return (1.0 - e * e) / e


def zhiying_qishao(e: Parameter) -> Scalar:
    """¾(1 − e²) exp(2(1 − e)), for e in [0, 1].

    Source: Zhang Zhiying and Lu Qishao, Journal of Dynamics and Control 4 (2006) 294.
    """
    e = _restitution(e)
    return 0.75 * (1.0 - e * e) * jnp.exp(2.0 * (1.0 - e))


def flores(e: Parameter) -> Scalar:
    """8(1 − e)/(5e), for e in (0, 1].

    Source: Flores, Machado, Silva and Martins, Multibody System Dynamics 25 (2011) 357.
    """
    e = _restitution(e, divides=True)
    return 1.6 * (1.0 - e) / e


def hu_guo(e: Parameter) -> Scalar:
    """3(1 − e)/(2e), for e in (0, 1].

    Source: Hu and Guo, Multibody System Dynamics 35 (2015) 131.
    """
    e = _restitution(e, divides=True)
    return 1.5 * (1.0 - e) / e


RESTITUTION_FORMULAS: Mapping[str, Callable[[Parameter], Scalar]] = MappingProxyType(
    {
        "hunt-crossley": hunt_crossley,
        "herbert-mcwhannell": herbert_mcwhannell,
        "lee-wang": lee_wang,
        "lankarani-nikravesh": lankarani_nikravesh,
        "gonthier": gonthier,
        "zhiying-qishao": zhiying_qishao,
        "flores": flores,
        "hu-guo": hu_guo,
    }
)
"""Each formula's name and its function: coefficient of restitution e [–] to factor χ [–]."""


def _restitution(e: Parameter, *, divides: bool = False) -> Scalar:
    e = as_float(e)
    check_within("e", e, 0.0, 1.0, open_below=divides)
    return e

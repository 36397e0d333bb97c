"""Catalogue of published walkers: names, sources, and starts at gaits that were published."""

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from jaxbiped.models._published_walkers import (
    bhounsule,
    garcia,
    goswami,
    hsu_chen,
    kuo,
    mcgeer,
    rimless_wheel,
    wisse,
)


class Model(NamedTuple):
    """A published walker.

    Attributes:
        words: description and source.
        make: its function in `jaxbiped.models`; without arguments, it returns the paper's scene.
        starts: arguments of `scene.state` for a state near each gait, by the gait's name: angles
            [rad], rates, held parts and standing feet.
        rigid: whether its scene is a `RigidScene`; otherwise it is a `Scene`.
    """

    words: str
    make: Callable[..., Any]
    starts: Mapping[str, Mapping[str, Any]]
    rigid: bool = True


def _struck(angle: float, swing: float, stance: float) -> dict[str, float]:
    """Behind a heel strike: the angle between slope's normal and stance leg, and both rates."""
    return {"theta_1": -angle, "theta_2": angle, "omega_1": swing, "omega_2": stance}


_SHORT = (0.193937369810184, -0.203866927442010)
_BENT = {
    "theta_thigh_1": 0.14,
    "theta_shank_1": -0.20,
    "omega_thigh_1": 3.4,
    "omega_shank_1": 1.7,
    "theta_thigh_2": -0.086,
    "theta_shank_2": 0.118,
    "omega_thigh_2": -0.88,
    "omega_shank_2": -0.88,
    "standing": "shank_2",
}

_KNEES_STRAIGHT = {
    "theta_thigh_1": -0.2386,
    "theta_shank_1": -0.2386,
    "omega_thigh_1": -0.0571,
    "omega_shank_1": -0.0571,
    "theta_thigh_2": 0.2386,
    "theta_shank_2": 0.2386,
    "omega_thigh_2": -1.1096,
    "omega_shank_2": -1.1096,
    "held": "shank_2",
}

MODELS: dict[str, Model] = {
    "garcia": Model(
        "the simplest walker: a mass on massless legs (Garcia et al. 1998)",
        garcia,
        {
            "long": _struck(
                0.200310900544287, -0.199832473004977 + 0.015822999948318, -0.199832473004977
            ),
            "short": _struck(_SHORT[0], _SHORT[1] * math.cos(2.0 * _SHORT[0]), _SHORT[1]),
        },
    ),
    "goswami": Model(
        "compass gait: point masses on legs and hip (Goswami et al. 1998)",
        goswami,
        {"gait": _struck(0.2710, -0.3772, -1.0918)},
    ),
    "mcgeer": Model(
        "straight legs on round feet (McGeer 1990)",
        mcgeer,
        {"gait": _struck(0.3084, -0.2807, -0.4031)},
    ),
    "mcgeer-kneed": Model(
        "legs with knees on round, compliant feet (McGeer 1990)",
        functools.partial(mcgeer, knees=True),
        {"gait": _BENT},
        rigid=False,
    ),
    "hsu-chen": Model(
        "legs with knees that lock, on point feet (Hsu Chen 2007)",
        hsu_chen,
        {"gait": _KNEES_STRAIGHT},
    ),
    "rimless-wheel": Model(
        "a wheel without a rim (McGeer 1990)",
        rimless_wheel,
        {"gait": {"theta_wheel": 3.0 * math.pi / 8.0, "omega_wheel": -0.4}},
    ),
    "wisse": Model(
        "a torso that bisects the legs' angle (Wisse et al. 2004)",
        wisse,
        {"gait": _struck(0.3033, -0.5348, -1.0653)},
    ),
    "kuo": Model(
        "the simplest walker pushing off on level ground (Kuo 2002)",
        kuo,
        {"gait": _struck(0.1946, -0.1878, -0.2030)},
    ),
    "bhounsule": Model(
        "point feet of passivewalker.m (Bhounsule 2009)",
        bhounsule,
        {
            "gait": _struck(
                0.200161072169750, -0.199906060087682 + 0.015805473227965, -0.199906060087682
            )
        },
    ),
    "bhounsule-round": Model(
        "round feet of passivewalker.m (Bhounsule 2009)",
        functools.partial(bhounsule, round_feet=True),
        {
            "gait": _struck(
                0.189472782205104, -0.239124222551699 + 0.053691703909393, -0.239124222551699
            )
        },
    ),
}
"""Published walkers by name, as commands take them."""

"""Gaits of the seed's walker as its contact stiffens, along paths in (K, c)."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import jaxbiped as jb

PATHS: dict[str, Callable[[float], tuple[float, float]]] = {
    "K alone": lambda s: (s, 1.0),
    "c alone": lambda s: (1.0, s),
    "c with K^(2/3)": lambda s: (s, s ** (2.0 / 3.0)),
    "c with K": lambda s: (s, s),
    "c with K^(3/2)": lambda s: (s, s**1.5),
}
"""By how much K and c grow for a factor s."""
DOUBLINGS, QUICK_DOUBLINGS = 10, 4
LAST = 4
"""Points that the rate is fitted to."""


class Approach(NamedTuple):
    """Gaits along a path: factors, and what their measures are from the rigid gait's.

    Attributes:
        factors: s of each gait found.
        period, step_length, spectral_radius: relative differences, one for each factor.
        peak_normal: peak forces [N].
        rates: exponents p of |difference| ∝ s^(−p) over the last points, by measure; None where
            the differences do not shrink steadily without a change of sign.
        ended: why no stiffer gait was found; None where the path was walked to its end.
    """

    factors: list[float]
    period: list[float]
    step_length: list[float]
    spectral_radius: list[float]
    peak_normal: list[float]
    rates: dict[str, float | None]
    ended: str | None


def approach(path: str, rigid: jb.Gait, doublings: int) -> Approach:
    """Follows a path, each gait searched from the last one's state."""
    found: list[Any] = []
    factors, guess, ended = [], None, None
    for k in range(doublings + 1):
        stiffer, damped = PATHS[path](2.0**k)
        scene = jb.seed_scene(K=1e6 * stiffer, c=1e7 * damped)
        gait = jb.find_gait(scene, guess, parameters=(), radius_sensitivities=False)
        if gait.outcome is not jb.gait.Search.FOUND:
            ended = f"at factor {2**k}: {gait.outcome}"
            break
        guess = gait.measures.state
        factors.append(2.0**k)
        found.append(gait.measures)
    gaps = {
        name: [float(getattr(m, name)) / float(getattr(rigid.measures, name)) - 1.0 for m in found]
        for name in ("period", "step_length", "spectral_radius")
    }
    rates = {name: rate(factors, gap) for name, gap in gaps.items()}
    return Approach(factors, *gaps.values(), [float(m.peak_normal) for m in found], rates, ended)


def rate(factors: list[float], gaps: list[float]) -> float | None:
    """The exponent with which the last differences shrink, where they do."""
    last = np.asarray(gaps[-LAST:])
    steady = bool(np.all(np.sign(last) == np.sign(last[0])) and np.all(np.diff(np.abs(last)) < 0.0))
    if len(last) < LAST or not steady:
        return None
    slope = np.polyfit(np.log(factors[-LAST:]), np.log(np.abs(last)), 1)[0]
    return float(-slope)

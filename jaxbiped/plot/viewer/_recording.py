"""Recordings: walks as the viewer plays them, a few thousand numbers each."""

import base64
import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._types import JsonObject
from jaxbiped.plot.viewer._knots import Channels, Tolerances

_COORDINATES = {
    "hip_x": "hip_vx",
    "hip_z": "hip_vz",
    "theta_1": "omega_1",
    "theta_2": "omega_2",
}
FORCES = ("normal_1", "normal_2", "tangential_1", "tangential_2")
ENERGIES = ("kinetic", "elastic", "supplied", "lost")
_FORCE, _ENERGY = 0.05, 5e-4
"""Errors allowed of forces, in weights, and of energies, in weights times leg lengths."""


class Footprint(NamedTuple):
    """Where a foot came down: time [s], foot (1 or 2), place along the slope [m].

    `strike` tells a heel strike from a foot that stood there at the start.
    """

    t: float
    foot: int
    x: float
    strike: bool


@dataclasses.dataclass(frozen=True)
class Recording:
    """A walk as it is played.

    Attributes:
        name: what it is called.
        ending: how it ended, in words.
        slope: [rad].
        l, r: hip to sole and foot radius [m].
        weight: of the walker [N].
        driven: whether actuators act on it.
        t: knots [s], shape (n,).
        channels: coordinates, rates, forces [N] and energies [J] at the knots, shape (n,).
        footprints: in order of time.
    """

    name: str
    ending: str
    slope: float
    l: float
    r: float
    weight: float
    driven: bool
    t: np.ndarray
    channels: Channels
    footprints: tuple[Footprint, ...]

    def numbers(self) -> JsonObject:
        """What is sent, ready for JSON: times in 64 bits, channels in 32, by base64."""
        return {
            "name": self.name,
            "ending": self.ending,
            "slope": self.slope,
            "l": self.l,
            "r": self.r,
            "weight": self.weight,
            "driven": self.driven,
            "t": _encoded(self.t, "<f8"),
            "channels": {name: _encoded(each, "<f4") for name, each in self.channels.items()},
            "footprints": [each._asdict() for each in self.footprints],
        }


def recording(
    scene: Any,
    name: str,
    ending: object,
    t: np.ndarray,
    channels: Channels,
    footprints: list[Footprint],
) -> Recording:
    """A recording of a scene's walk, as far as its states are numbers."""
    bad = ~np.isfinite([channels[each] for each in (*_COORDINATES, *_COORDINATES.values())])
    broken = np.flatnonzero(bad.any(axis=0))
    count = max(int(broken[0]), 2) if broken.size else len(t)
    return Recording(
        name=name,
        ending=str(ending),
        slope=float(scene.ground.slope),
        l=float(scene.walker.l),
        r=float(scene.walker.r),
        weight=_weight(scene),
        driven=scene.actuation is not None,
        t=t[:count],
        channels={each: values[:count] for each, values in channels.items()},
        footprints=tuple(footprints),
    )


def _weight(scene: Any) -> float:
    return float(scene.walker.total_mass) * float(scene.ground.g)


def time_unit(scene: Any) -> float:
    """√(l/g), in which a walker moves [s]."""
    return math.sqrt(float(scene.walker.l) / float(scene.ground.g))


def tolerances_for(scene: Any, exact: float) -> Tolerances:
    """The errors allowed: `exact` of angles [rad], and of lengths in parts of the legs'."""
    weight = _weight(scene)
    length = exact * float(scene.walker.l)
    allowed = {name: length if name.startswith("hip") else exact for name in _COORDINATES}
    return Tolerances(
        cubic={name: (rate, allowed[name]) for name, rate in _COORDINATES.items()},
        linear={name: _FORCE * weight for name in FORCES}
        | {name: _ENERGY * weight * float(scene.walker.l) for name in ENERGIES},
        shortest=1e-4 * time_unit(scene),
    )


def _encoded(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.asarray(values, dtype=kind).tobytes()).decode("ascii")

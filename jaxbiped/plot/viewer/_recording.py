"""Recordings: walks as the viewer plays them, a few thousand numbers each."""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._types import JsonObject
from jaxbiped.dynamics._contacts import Contacts, contacts
from jaxbiped.dynamics._energy import energies
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.dynamics._state import State
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.measure._samples import at_steps, evaluate_along
from jaxbiped.plot._samples import end_time, state_at
from jaxbiped.plot.viewer._knots import Channels, Tolerances, adaptive_knots
from jaxbiped.plot.viewer._page import base64_of
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._trajectory import Trajectory

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
        plain = ("name", "ending", "slope", "l", "r", "weight", "driven")
        return {name: getattr(self, name) for name in plain} | {
            "t": base64_of(self.t, "<f8"),
            "channels": {name: base64_of(each, "<f4") for name, each in self.channels.items()},
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


_EXACT, _LOOKS_RIGHT = 1e-5, 1e-4
"""Errors allowed of angles [rad], and of lengths in parts of the legs'."""
_EVEN, _MOST = 0.05, 20_000
"""Even times to begin with [√(l/g)], and their largest number."""
_STEPS = 5e-3
"""The solver's steps are begun with, too, as far as they are this far apart [√(l/g)]."""


def record_walk(
    scene: Any, trajectory: Trajectory, name: str, *, motion_only: bool = False
) -> Recording:
    """A recording of a walk of a `Scene` or a `RedundantScene`, as long as its trajectory.

    With `motion_only` it has no forces or energies, and its motion need only look right. Raises
    `ValueError` for a trajectory that was not saved step by step, or a batch.
    """
    if end_time(trajectory) <= 0.0:
        raise ArgumentError("trajectory ends where it begins: there is no motion to look at.")
    first = _first_times(scene, trajectory)
    started = evaluate_along(scene, state_at(trajectory, first[:1]), energies)

    def evaluate(t: np.ndarray) -> Channels:
        states = state_at(trajectory, t)
        hip = minimal_state(scene, states)
        motion = {field: np.asarray(getattr(hip, field)) for field in State._fields}
        if motion_only:
            return motion
        now = evaluate_along(scene, states, energies)
        return {
            **motion,
            **_forces(evaluate_along(scene, states, contacts)),
            "kinetic": now.kinetic,
            "elastic": now.elastic,
            "supplied": started.gravitational - now.gravitational,
            "lost": started.total - now.total,
        }

    exact = _LOOKS_RIGHT if motion_only else _EXACT
    t, channels = adaptive_knots(evaluate, first, tolerances_for(scene, exact))
    prints = _footprints(scene, trajectory)
    return recording(scene, name, trajectory.outcome, t, channels, prints)


def _first_times(scene: Scene, trajectory: Trajectory) -> np.ndarray:
    """Even times, and the solver's steps where they are not too close."""
    last, unit = end_time(trajectory), time_unit(scene)
    steps = np.asarray(trajectory.t)
    count = min(max(int(last / (_EVEN * unit)), 2), _MOST)
    far = np.unique(np.floor(steps / (_STEPS * unit)), return_index=True)[1]
    times = np.union1d(np.linspace(0.0, last, count + 1), steps[far])
    times = times[(times >= 0.0) & (times <= last)]
    apart = np.diff(times) > 1e-6 * unit
    return times[np.concatenate([[True], apart[:-1] | (times[1:-1] == last), [True]])]


def _forces(found: Contacts) -> Channels:
    forces: Channels = {}
    for leg, force in enumerate(found.forces, 1):
        forces[f"normal_{leg}"] = np.asarray(force.normal)
        if force.tangential is not None:
            forces[f"tangential_{leg}"] = np.asarray(force.tangential)
    return forces


def _footprints(scene: Scene, trajectory: Trajectory) -> list[Footprint]:
    """Of feet that stand at the start, and of all heel strikes."""
    start = at_steps(scene, trajectory, contacts)
    prints = [
        Footprint(0.0, leg, float(foot.x[0]), strike=False)
        for leg, (foot, touching) in enumerate(zip(start.feet, start.touching, strict=True), 1)
        if touching[0]
    ]
    strikes = heel_strikes(scene, trajectory)
    if strikes.time_s.size:
        feet = evaluate_along(scene, state_at(trajectory, strikes.time_s), contacts).feet
        for k, (time, leg) in enumerate(zip(*strikes, strict=True)):
            place = float(feet[leg - 1].x[k])
            prints.append(Footprint(float(time), int(leg), place, strike=True))
    return prints

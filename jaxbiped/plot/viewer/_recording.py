"""Recordings: walks as the viewer plays them, a few thousand numbers each."""

import base64
import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError
from jaxbiped._types import JsonObject, Scalar
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.dynamics._energy import Energies, energies, is_driven, powers
from jaxbiped.dynamics._equivalent_states import whole_state
from jaxbiped.dynamics._foot_forces import foot_forces
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.measure._samples import evaluate_along, places_of_standing, sample
from jaxbiped.plot._contact_charts import forces_in
from jaxbiped.plot._samples import (
    Channels,
    RigidMotion,
    Tolerances,
    adaptive_knots,
    end_time,
    rigid_motion,
    state_at,
)
from jaxbiped.plot._skeleton import Skeleton, body_motion, motion_names, names_by_foot, skeleton_of
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.simulate._trajectory import Trajectory

_FORCES = ("normal", "tangential")
_ENERGIES = ("kinetic", "elastic", "supplied", "driven", "lost")
_FORCE, _ENERGY = 0.05, 5e-4
"""Errors allowed of forces, in weights, and of energies, in weights times the walker's height."""


def base64_of(values: npt.ArrayLike, kind: str) -> str:
    """Numbers as they are sent, of a kind such as "<f8"."""
    return base64.b64encode(np.asarray(values, dtype=kind).tobytes()).decode("ascii")


class Footprint(NamedTuple):
    """Where a leg came down: time [s], leg (from 1 on), place along the slope [m].

    `strike` tells a heel strike from a leg that stood there at the start.
    """

    t: float
    leg: int
    x: float
    strike: bool


@dataclasses.dataclass(frozen=True)
class Recording:
    """A walk as it is played.

    Attributes:
        name: what it is called.
        ending: how it ended, in words.
        slope: [rad].
        skeleton: what is drawn.
        weight: of the walker [N].
        driven: whether motors or actuators act on it.
        t: knots [s], shape (n,).
        channels: coordinates, rates, forces [N] and energies [J] at the knots, shape (n,).
        footprints: in order of time.
    """

    name: str
    ending: str
    slope: float
    skeleton: Skeleton
    weight: float
    driven: bool
    t: np.ndarray
    channels: Channels
    footprints: tuple[Footprint, ...]

    def numbers(self) -> JsonObject:
        """What is sent, ready for JSON: times in 64 bits, channels in 32, by base64."""
        plain = ("name", "ending", "slope", "weight", "driven")
        return {name: getattr(self, name) for name in plain} | {
            "skeleton": self.skeleton.numbers(),
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
    moving = [channels[each] for each in motion_names(scene.mechanism.structure)]
    broken = np.flatnonzero(~np.isfinite(moving).all(axis=0))
    count = max(int(broken[0]), 2) if broken.size else len(t)
    return Recording(
        name=name,
        ending=str(ending),
        slope=float(scene.ground.slope),
        skeleton=skeleton_of(scene.mechanism),
        weight=_weight(scene),
        driven=is_driven(scene),
        t=t[:count],
        channels={each: values[:count] for each, values in channels.items()},
        footprints=tuple(footprints),
    )


def _weight(scene: Any) -> float:
    return float(scene.mechanism.total_mass) * float(scene.ground.g)


def time_unit(scene: Any) -> float:
    """√(height/g), in which a walker moves [s]."""
    return math.sqrt(float(scene.mechanism.height) / _gravity(scene))


def _gravity(scene: Any) -> float:
    """What sizes are measured by [m/s²]: 1 where there is no gravity."""
    return float(scene.ground.g) or 1.0


def tolerances_for(scene: Any, exact: float) -> Tolerances:
    """The errors allowed: `exact` of angles [rad], and of lengths in parts of the height."""
    structure = scene.mechanism.structure
    weight = float(scene.mechanism.total_mass) * _gravity(scene)
    height = float(scene.mechanism.height)
    names, half = motion_names(structure), 2 + len(structure.bodies)
    allowed = [exact * height] * 2 + [exact] * len(structure.bodies)
    return Tolerances(
        cubic=dict(zip(names[:half], zip(names[half:], allowed, strict=True), strict=True)),
        linear=dict.fromkeys(names_by_foot(structure, *_FORCES), _FORCE * weight)
        | dict.fromkeys(_ENERGIES, _ENERGY * weight * height),
        shortest=1e-4 * time_unit(scene),
    )


_EXACT, _LOOKS_RIGHT = 1e-5, 1e-4
"""Errors allowed of angles [rad], and of lengths in parts of the walker's height."""
_EVEN, _MOST = 0.05, 20_000
"""Even times to begin with [√(height/g)], and their largest number."""
_STEPS = 5e-3
"""The solver's steps are begun with, too, as far as they are this far apart [√(height/g)]."""


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
    edges, work = first, None
    if is_driven(scene) and not motion_only:
        flows = sample(scene, trajectory, powers, first)
        edges, work = flows.edges, np.cumsum(flows.integral(flows.values.actuation))

    def evaluate(t: np.ndarray) -> Channels:
        states = state_at(trajectory, t)
        motion: Channels = evaluate_along(scene, states, body_motion)
        if motion_only:
            return motion
        now = evaluate_along(scene, states, energies)
        forces = forces_in(evaluate_along(scene, states, contacts))
        driven = None if work is None else np.interp(t, edges, np.append(0.0, work))
        return motion | forces | _energy_channels(now, started, driven)

    exact = _LOOKS_RIGHT if motion_only else _EXACT
    t, channels = adaptive_knots(evaluate, first, tolerances_for(scene, exact))
    prints = _footprints(scene, trajectory)
    return recording(scene, name, trajectory.outcome, t, channels, prints)


def _energy_channels(now: Any, first: Any, driven: np.ndarray | None) -> Channels:
    """What the chart of energies has [J], shape (n,): held, given by gravity and motors, and lost.

    Of `Energies` along a walk, those at first, and the work of motors, None for a passive walker.
    """
    supplied, lost = first.gravitational - now.gravitational, first.total - now.total
    curves = {"kinetic": now.kinetic, "elastic": now.elastic, "supplied": supplied, "lost": lost}
    return curves if driven is None else curves | {"driven": driven, "lost": lost + driven}


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


def _footprints(scene: Scene, trajectory: Trajectory) -> list[Footprint]:
    """Of legs that stand at the start, and of all heel strikes."""
    structure, strikes = scene.mechanism.structure, heel_strikes(scene, trajectory)
    times = np.concatenate([np.asarray(trajectory.t)[:1], strikes.time_s])
    found = evaluate_along(scene, state_at(trajectory, times), contacts)

    def place(leg: int, k: int) -> float:
        """Of the deepest foot of a leg."""
        own = structure.feet_of_leg[leg]
        return float(found.feet[max(own, key=lambda foot: found.feet[foot].penetration[k])].x[k])

    standing = [
        Footprint(0.0, leg + 1, place(leg, 0), strike=False)
        for leg, feet in enumerate(structure.feet_of_leg)
        if any(found.touching[foot][0] for foot in feet)
    ]
    return standing + [
        Footprint(float(time), int(leg), place(leg - 1, k), strike=True)
        for k, (time, leg) in enumerate(zip(*strikes, strict=True), 1)
    ]


_MOST_IN_A_FOOTSTEP = 200
"""Knots of a footstep of a rigid walk: as far apart as the even times, if there are not more."""


def record_rigid_walk(scene: RigidScene, walk: Trajectory[Any], name: str) -> Recording:
    """A recording of a rigid walk from its first heel strike.

    Where the mode changes rates jump: there are knots on both sides.
    """
    motion = rigid_motion(scene, walk)
    t = _knot_times(motion, _EVEN * time_unit(scene))
    channels = motion.along(_quantities, t)
    held: list[Any] = [channels.pop(name) for name in Energies._fields]
    now, first = Energies(*held), Energies(*(values[0] for values in held))
    driven = motion.driving_work(t) if is_driven(scene) else None
    channels |= _energy_channels(now, first, driven)
    if not now.elastic.any():
        del channels["elastic"]
    return recording(scene, name, walk.outcome, t, channels, _rigid_footprints(motion))


def _knot_times(motion: RigidMotion, apart: float) -> np.ndarray:
    """Even times within each footstep [s], and both sides of all jumps."""
    times = [motion.both_sides()]
    for first, last in zip(motion.began, [*motion.began[1:], motion.end], strict=True):
        count = min(max(int(np.ceil((last - first) / apart)), 8), _MOST_IN_A_FOOTSTEP)
        times.append(np.linspace(first, last, count + 1)[:-1])
    return np.unique(np.concatenate(times))


def _quantities(scene: RigidScene, state: Any) -> dict[str, Scalar]:
    forces = {
        f"{word}_{k}": force
        for k, both in enumerate(foot_forces(scene, state), 1)
        for word, force in both._asdict().items()
    }
    held = energies(scene, state)._asdict()
    return body_motion(scene, whole_state(scene, state)) | forces | held


def _rigid_footprints(motion: RigidMotion) -> list[Footprint]:
    """Where each footstep's stance foot comes down."""
    place = places_of_standing(motion.scene, motion.starts)
    return [
        Footprint(float(time), 1 + int(leg), float(x), strike=bool(time > 0.0))
        for time, leg, x in zip(motion.began, motion.standing_legs(), place, strict=True)
    ]

"""Case: a simulation at an extreme, told by plain numbers that a file can hold."""

import dataclasses
import hashlib
import json
import math
from typing import Any

import numpy as np
from _scenes import seed_with
from reference.compliant import FRICTION, FRICTION_AT, NORMAL, NORMAL_AT, SIZE, gravity

import jaxbiped as jb

_FIELDS = ("hip_x", "hip_z", "theta_1", "theta_2", "hip_vx", "hip_vz", "omega_1", "omega_2")
_DEPTH = 6.3e-4
"""Depth at which the standing foot starts, by that of the seed's walker [m]."""
_STANDING = dict(
    hip_x=0.0, theta_1=-0.2479, theta_2=0.1655,
    hip_vx=0.49797, hip_vz=0.05853, omega_1=-0.0052, omega_2=-1.2565,
)  # fmt: skip
_STRIKING = dict(
    hip_x=0.0, theta_1=0.2389649928719203, theta_2=-0.2131208501353999,
    hip_vx=0.6779715341777804, hip_vz=-0.11663022668189385,
    omega_1=-1.4100282381682745, omega_2=-1.726217738899573,
)  # fmt: skip
"""Starts of the seed's walk: as the paper gives it, and 5 ms before heel strike."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A simulation at an extreme.

    Attributes:
        group: what it is about: a parameter, a pair, or a kind of start or question.
        at: the extreme values by name, for tables.
        parameters: of the scene, arguments of `seed_scene`.
        normal, friction: names of laws, like the seed's with these parameters.
        clears: whether a swinging foot clears the ground.
        start: "standing", "striking", and what is changed in it, in SI units.
        duration: simulated time, for the seed's leg and gravity [s].
        asked: arguments of `simulate` beside these.
    """

    group: str
    at: dict[str, float | str]
    parameters: dict[str, float] = dataclasses.field(default_factory=dict)
    normal: str = "ristow-schafer"
    friction: str = "bengisu-akay"
    clears: bool = True
    start: str = "standing"
    changed: dict[str, float] = dataclasses.field(default_factory=dict)
    duration: float = 0.1
    asked: dict[str, Any] = dataclasses.field(default_factory=lambda: {"accuracy": 1e-4})

    @property
    def key(self) -> str:
        """A name for the store, the same wherever the case is the same."""
        return key_of(self)

    def scene(self) -> jb.Scene:
        """The scene.

        Raises:
            ArgumentError: a parameter that is not allowed.
        """
        clearance = jb.laws.StanceRotation() if self.clears else jb.laws.AlwaysTouching()
        scene = seed_with(self.normal, self.friction, **self.parameters)
        return dataclasses.replace(scene, clearance=clearance)

    def state(self) -> dict[str, float]:
        """The start by field [SI]; its leg length and gravity scale it."""
        told = dict(_STANDING if self.start == "standing" else _STRIKING)
        l, r = self.parameters.get("l", 0.4), self.parameters.get("r", 0.08)
        speed, rate = math.sqrt(l / 0.4) * self._root_g, self._root_g / math.sqrt(l / 0.4)
        for name in told:
            told[name] *= speed if "_v" in name else rate if "omega" in name else 1.0
        changed = dict(self.changed)
        height = changed.pop("height", -_DEPTH * l / 0.4)
        told |= changed
        told["hip_z"] = r + (l - r) * math.cos(told["theta_2"]) + height
        for name in ("theta_1", "theta_2"):
            told[name] = _within_a_turn(told[name])
        return {name: float(told[name]) for name in _FIELDS}

    @property
    def time(self) -> float:
        """The time to simulate [s], that of the walker's leg and gravity."""
        return self.duration * math.sqrt(self.parameters.get("l", 0.4) / 0.4) / self._root_g

    @property
    def _root_g(self) -> float:
        return math.sqrt(max(self.parameters.get("g", 9.8), 1e-3) / 9.8)


def _within_a_turn(angle: float) -> float:
    """The angle without whole turns [rad]."""
    turn = 2.0 * math.pi
    return angle if abs(angle) <= math.pi else angle - turn * round(angle / turn)


def key_of(case: Any) -> str:
    """The same text for the same numbers of a dataclass."""
    told = json.dumps(dataclasses.asdict(case), sort_keys=True)
    return hashlib.sha1(told.encode()).hexdigest()[:16]


def start_of(scene: jb.Scene, start: dict[str, float], dtype: str = "float64") -> Any:
    """The start as `simulate` takes it."""
    cast: dict[str, Any] = {name: np.asarray(value, dtype) for name, value in start.items()}
    if scene.has_bristles:
        zero: Any = np.zeros((), dtype)
        return jb.dynamics.BristleState(**cast, bristle_1=zero, bristle_2=zero)
    return jb.State(**cast)


def check_numbers(scene: jb.Scene) -> np.ndarray:
    """A scene as the independent equations take it: plain numbers, shape (SIZE,)."""
    walker, ground = scene.walker, scene.ground
    p = np.zeros(SIZE)
    p[:6] = walker.m, walker.J, walker.l, walker.d, walker.r, walker.hip_mass
    p[6:8] = gravity(float(ground.g), float(ground.slope))
    p[8] = isinstance(scene.clearance, jb.laws.StanceRotation)
    laws = (NORMAL_AT, NORMAL, scene.normal), (FRICTION_AT, FRICTION, scene.friction)
    for at, names, law in laws:
        values = [float(value) for value in vars(law).values() if value is not None]
        p[at : at + 1 + len(values)] = names.index(law.name), *values
    return p


def check_start(scene: jb.Scene, start: dict[str, float]) -> np.ndarray:
    """A start as the independent equations take it, shape (8,), or (10,) with bristles."""
    told = [start[name] for name in _FIELDS]
    return np.array(told + [0.0, 0.0] * scene.has_bristles)

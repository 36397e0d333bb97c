"""Skeleton of a mechanism: what of it is drawn, what that is called, and where it is in a motion.

The viewer's page has the same from `Skeleton.numbers`.
"""

import dataclasses
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from jaxbiped._types import JsonObject, Scalar
from jaxbiped.dynamics._equivalent_states import minimal_state, motion_in
from jaxbiped.plot import style
from jaxbiped.plot.style import Look
from jaxbiped.scene._bodies import Point
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._structure import Structure

Place: TypeAlias = tuple[float, float]
"""Of a point in a body's frame: down the body and ahead [m]."""


class Part(NamedTuple):
    """A body as it is drawn.

    Attributes:
        name: its name.
        label: what legends call it.
        look: how it is drawn.
        parent: number of the body that it hangs on, −1 for the root point.
        hinge: place of its own hinge on its parent.
        centre: its mass centre.
        path: the line that shows it, from its own hinge to what hangs on it and to its feet; to its
            mass centre where there is neither.
    """

    name: str
    label: str
    look: Look
    parent: int
    hinge: Place
    centre: Place
    path: tuple[Place, ...]


class Sole(NamedTuple):
    """A foot as it is drawn.

    Attributes:
        label: what legends call it.
        look: how it is drawn.
        part: number of its body.
        leg: number of its leg.
        centre: of its circle.
        radius: of its circle [m].
    """

    label: str
    look: Look
    part: int
    leg: int
    centre: Place
    radius: float


class Pose(NamedTuple):
    """Points of a walker, horizontal and vertical position [m], arrays of shape (n, 2).

    Attributes:
        root: the root point.
        hinges: of each body, its own.
        centres: of each body, its mass centre.
        lines: of each body, its path, of shape (n, points, 2).
        feet: centres of all feet.
    """

    root: np.ndarray
    hinges: tuple[np.ndarray, ...]
    centres: tuple[np.ndarray, ...]
    lines: tuple[np.ndarray, ...]
    feet: tuple[np.ndarray, ...]


@dataclasses.dataclass(frozen=True)
class Skeleton:
    """A mechanism as it is drawn.

    Attributes:
        root: name of the root point.
        height: of the root point with all angles 0 [m].
        parts: its bodies.
        feet: its feet.
        legs: what legends call its legs.
    """

    root: str
    height: float
    parts: tuple[Part, ...]
    feet: tuple[Sole, ...]
    legs: tuple[str, ...]

    @property
    def noun(self) -> str:
        """What all its bodies are."""
        carry = {sole.part for sole in self.feet}
        alone = all(each.parent < 0 and each.look.group < len(self.legs) for each in self.parts)
        all_legs = alone and len(carry) == len(self.parts) == len(self.legs)
        return "leg" if all_legs else "body"

    @property
    def above(self) -> float:
        """How far it stands above its root point with all angles 0 [m]."""
        angles = (f"theta_{part.name}" for part in self.parts)
        names = (f"{self.root}_x", f"{self.root}_z", *angles)
        lines = self.pose(dict.fromkeys(names, np.zeros(1)), 0.0).lines
        return max(0.0, *(float(line[..., 1].max()) for line in lines))

    def pose(self, motion: dict[str, np.ndarray], slope: float) -> Pose:
        """Where everything is, gravity pointing down the page; numbers of shape (n,) by name."""
        root = motion[f"{self.root}_x"], motion[f"{self.root}_z"]
        angles = [motion[f"theta_{part.name}"] for part in self.parts]
        hinges: list[Any] = []
        for part in self.parts:
            k = part.parent
            hinges.append(root if k < 0 else _point(hinges[k], angles[k], part.hinge))

        def seen(k: int, place: Place) -> np.ndarray:
            return upright(slope, *_point(hinges[k], angles[k], place))

        return Pose(
            upright(slope, *root),
            tuple(upright(slope, *each) for each in hinges),
            tuple(seen(k, part.centre) for k, part in enumerate(self.parts)),
            tuple(
                np.stack([seen(k, place) for place in part.path], axis=1)
                for k, part in enumerate(self.parts)
            ),
            tuple(seen(sole.part, sole.centre) for sole in self.feet),
        )

    def numbers(self) -> JsonObject:
        """The same for the viewer's page, ready for JSON."""
        return {
            "root": self.root,
            "height": self.height,
            "above": self.above,
            "noun": self.noun,
            "parts": [each._asdict() | {"look": each.look.words} for each in self.parts],
            "feet": [each._asdict() | {"look": each.look.words} for each in self.feet],
            "legs": [{"label": label, "look": Look(k).words} for k, label in enumerate(self.legs)],
        }


def skeleton_of(mechanism: Mechanism) -> Skeleton:
    """How a mechanism is drawn."""
    structure, bodies = mechanism.structure, mechanism.bodies
    looks = looks_of(structure)
    feet = [_place(foot.centre) for foot in mechanism.feet]
    parts = tuple(
        Part(
            name=body.name,
            label=style.label_of(body.name, "leg" if j in structure.feet else "body"),
            look=looks[j],
            parent=structure.parents[j],
            hinge=_place(body.at),
            centre=_place(body.centre),
            path=_path(mechanism, j, feet),
        )
        for j, body in enumerate(bodies)
    )
    places = zip(structure.feet_told, structure.feet, structure.leg_of_foot, strict=True)
    soles = tuple(
        Sole(
            label=style.label_of(name, "leg"),
            look=Look(leg, structure.feet_of_leg[leg].index(k)),
            part=j,
            leg=leg,
            centre=feet[k],
            radius=float(mechanism.feet[k].radius or 0.0),
        )
        for k, (name, j, leg) in enumerate(places)
    )
    legs = tuple(style.label_of(name, "leg") for name in structure.legs)
    return Skeleton(structure.root, float(mechanism.height), parts, soles, legs)


def looks_of(structure: Structure) -> tuple[Look, ...]:
    """How each body is drawn: what carries the feet of one leg alone is part of that leg."""
    looks: list[Look] = []
    alone = len(structure.legs)
    for j, parent in enumerate(structure.parents):
        leg = structure.leg_of_body(j)
        if leg is None:
            looks.append(Look(alone))
            alone += 1
            continue
        above = looks[parent] if parent >= 0 else None
        looks.append(Look(leg, above.depth + 1 if above and above.group == leg else 0))
    return tuple(looks)


def motion_names(structure: Structure) -> tuple[str, ...]:
    """Names of place and angles of the root point and all bodies, then those of their rates."""
    root, bodies = structure.root, structure.bodies
    angles, rates = ([f"{word}_{name}" for name in bodies] for word in ("theta", "omega"))
    return (f"{root}_x", f"{root}_z", *angles, f"{root}_vx", f"{root}_vz", *rates)


def names_by_foot(structure: Structure, *words: str) -> tuple[str, ...]:
    """Names of what each foot has, such as "normal_1", "normal_2", "tangential_1"."""
    count = range(1, len(structure.feet) + 1)
    return tuple(f"{word}_{k}" for word in words for k in count)


def body_motion(scene: Any, state: Any) -> dict[str, Scalar]:
    """Place and angles of the root point and all bodies, and their rates, by name.

    What couplings fix is there, too.
    """
    motion = motion_in(scene, minimal_state(scene, state))
    structure = scene.mechanism.structure
    named = {f"{structure.root}_{name}": getattr(motion, name) for name in ("x", "z", "vx", "vz")}
    named |= {f"theta_{b}": x for b, x in zip(structure.bodies, motion.angles, strict=True)}
    named |= {f"omega_{b}": x for b, x in zip(structure.bodies, motion.rates, strict=True)}
    return named


def poses(scene: Any, motion: dict[str, np.ndarray]) -> Pose:
    """A walker in a motion, numbers of shape (n,) by name."""
    return skeleton_of(scene.mechanism).pose(motion, float(scene.ground.slope))


def upright(slope: float, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Points of the slope's frame [m] with gravity pointing down the page, shape (..., 2)."""
    horizontal = np.cos(slope) * x + np.sin(slope) * z
    vertical = np.cos(slope) * z - np.sin(slope) * x
    return np.stack([horizontal, vertical], axis=-1)


def _path(mechanism: Mechanism, body: int, feet: list[Place]) -> tuple[Place, ...]:
    """A line from a body's hinge to each hinge on it, and round the feet of each leg on it."""
    structure = mechanism.structure
    ends = [[_place(mechanism.bodies[k].at)] for k in structure.children[body]]
    for leg in structure.feet_of_leg:
        ends.append([feet[k] for k in leg if structure.feet[k] == body])
    path: list[Place] = [(0.0, 0.0)]
    for stretch in ends:
        away = [place for place in stretch if place not in path]
        if away:
            path += [*away, (0.0, 0.0)]
    if len(path) == 1:
        return (0.0, 0.0), _place(mechanism.bodies[body].centre)
    return tuple(path[:-1] if len(path) == 3 else path)


def _place(point: Point | None) -> Place:
    if point is None:
        return 0.0, 0.0
    return float(point.along), 0.0 if point.ahead is None else float(point.ahead)


def _point(start: Any, angle: np.ndarray, place: Place) -> tuple[np.ndarray, np.ndarray]:
    """A point of a body whose own hinge is at `start`."""
    (x, z), (along, ahead) = start, place
    sine, cosine = np.sin(angle), np.cos(angle)
    return x + along * sine + ahead * cosine, z - along * cosine + ahead * sine

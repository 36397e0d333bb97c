"""Mechanisms as plain numbers, and how a scene's parameters change them."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from reference.mechanism_equations import LAWS, Part, Tree

import jaxbiped as jb

_CHANGE = 1e-4
"""Relative change of a parameter; numbers are polynomials of low degree in it."""
_OF_PARTS = {
    "Spring": ("stiffness", "damping", "rest"),
    "Stop": ("upper", "lower"),
    "Coupling": ("rest",),
    "Motor": (),
}


@dataclasses.dataclass
class _Numbers:
    """Numbers with their places by name."""

    values: list[float] = dataclasses.field(default_factory=list)
    names: dict[str, int] = dataclasses.field(default_factory=dict)

    def keep(self, name: str, value: Any) -> int:
        """The place of a number, new; what was left out is 0."""
        self.names[name] = len(self.values)
        self.values.append(0.0 if value is None else float(value))
        return self.names[name]


def bodies_of(mechanism: jb.Mechanism, slope: float, g: float) -> Tree:
    """The bodies of a mechanism and their couplings, without feet and torques."""
    return _tree(mechanism, slope, g, _Numbers(), only=("Coupling",))


def tree_of(scene: jb.Scene) -> Tree:
    """The mechanism of a scene with the seed's laws of contact."""
    mechanism, numbers = scene.mechanism, _Numbers()
    for k, foot in enumerate(mechanism.feet):
        numbers.keep(f"foot {k} along", foot.centre.along)
        numbers.keep(f"foot {k} ahead", foot.centre.ahead)
        numbers.keep(f"foot {k} radius", foot.radius)
    for name in LAWS:
        law = scene.normal if name in ("K", "c", "n") else scene.friction
        numbers.keep(name, getattr(law, name))
    tree = _tree(mechanism, scene.ground.slope, scene.ground.g, numbers, only=tuple(_OF_PARTS))
    structure = mechanism.structure
    return tree._replace(
        feet=structure.feet,
        legs=structure.leg_of_foot,
        gated=isinstance(scene.clearance, jb.laws.StanceRotation),
    )


def _tree(
    mechanism: jb.Mechanism, slope: Any, g: Any, numbers: _Numbers, only: Sequence[str]
) -> Tree:
    structure, parts = mechanism.structure, []
    numbers.keep("slope", slope)
    numbers.keep("g", g)
    numbers.keep("root mass", mechanism.root_mass)
    for j, body in enumerate(mechanism.bodies):
        numbers.keep(f"mass {j}", body.mass)
        numbers.keep(f"inertia {j}", body.inertia)
        for what in ("centre", "at"):
            place = getattr(body, what)
            numbers.keep(f"{what} {j} 0", None if place is None else place.along)
            numbers.keep(f"{what} {j} 1", None if place is None else place.ahead)
    for k, (joint, angle) in enumerate(zip(mechanism.joints, structure.joints, strict=True)):
        kind, read = type(joint).__name__, ()
        if kind not in only:
            continue
        given = {name: getattr(joint, name) for name in _OF_PARTS[kind]}
        if kind == "Stop":
            given |= {name: getattr(joint.law, name) for name in ("K", "c", "n")}
        if kind == "Motor":
            given |= {name: getattr(joint.law, name) for name in ("kp", "kd")}
            read = _weights(joint.law.of, structure.bodies)
        places = {
            name: numbers.keep(f"part {k} {name}", value)
            for name, value in given.items()
            if value is not None
        }
        parts.append(Part(kind.lower(), angle.weights, angle.vertical, places, read))
    sides = structure.body_twins or tuple(range(len(structure.bodies)))
    return Tree(
        p=np.array(numbers.values),
        names=numbers.names,
        parents=structure.parents,
        feet=(),
        legs=(),
        sides=tuple(sides),
        parts=tuple(parts),
        gated=False,
    )


def _weights(angle: Sequence[tuple[str, float]], bodies: Sequence[str]) -> Any:
    return tuple((bodies.index(name), weight) for name, weight in angle if name in bodies)


def directions_of(scene: jb.Scene, names: Sequence[str]) -> np.ndarray:
    """Derivatives of the tree's numbers with respect to a scene's parameters, (k, P)."""
    values, found = jb.parameter_values(scene), []
    for name in names:
        value = float(values[name])
        step = _CHANGE * (abs(value) or 1.0)
        there = [
            tree_of(jb.with_parameters(scene, {name: value + steps * step})).p
            for steps in range(3)  # upwards: some are at their least value
        ]
        found.append((4.0 * there[1] - 3.0 * there[0] - there[2]) / (2.0 * step))
    return np.array(found).reshape(len(names), -1)

"""Mechanisms: any planar tree of rigid bodies on round feet, given as data."""

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._checks import ArgumentError
from jaxbiped._parameter_declaration import check_parameters, parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene._bodies import Body, Foot, check_name
from jaxbiped.scene._couplings import fixed_angles
from jaxbiped.scene._joint_parts import AbstractJointPart, Coupling
from jaxbiped.scene._mechanism_pieces import (
    angle_of_part,
    check_pieces,
    foot_names_of,
    number_of,
    parents_of,
    turn_of,
)
from jaxbiped.scene._mirror import body_twins, foot_twins, joint_twins
from jaxbiped.scene._structure import Indices, Structure, pair_name
from jaxbiped.scene._zero_pose import check_inertia


class Mechanism(eqx.Module):
    """A planar tree of rigid bodies on round feet; a frozen pytree of its parameters.

    Bodies hang by hinges on a root point or on one another. With a `mirror` two halves are each
    other's images: their parameters are the same leaves, so that a derivative is the pair's, and a
    cycle of its walk is a step.

    Args:
        root: name of the root point, as "hip": its place is `hip_x`, `hip_z` in states.
        root_mass: point mass there [kg]; None for none.
        bodies: the bodies, parents before children.
        feet: their feet, at least one.
        joints: what acts at joints: `Spring`, `Stop`, `Latch`, `Coupling`.
        mirror: pairs of bodies, first the one that swings where a cycle begins, then the one that
            stands.
        turn: `{body: N}` of a body that looks the same, its feet too, after an N-th of a turn.

    Attributes:
        root_mass: see above.
        pieces: bodies, feet and joint parts with parameters of their own: of mirror images one.
        structure: how they hang together.

    Raises:
        ArgumentError: names that are not unique or not known, what is no symmetry, couplings that
            repeat each other, or masses that leave a motion without inertia.
    """

    root_mass: Parameter | None = parameter(
        "mass of the root point", "", "kg", minimum=0.0, default=None
    )
    pieces: tuple[Body | Foot | AbstractJointPart, ...] = eqx.field(kw_only=True)
    structure: Structure = eqx.field(static=True, kw_only=True)

    def __init__(
        self,
        *,
        root: str = "hip",
        root_mass: Parameter | None = None,
        bodies: Sequence[Body],
        feet: Sequence[Foot],
        joints: Sequence[AbstractJointPart] = (),
        mirror: Sequence[tuple[str, str]] = (),
        turn: Mapping[str, int] | None = None,
    ) -> None:
        check_name("root", root)
        check_pieces(root, bodies, feet, joints)
        names = [each.name for each in bodies]
        parents = parents_of(bodies, names)
        at_feet = tuple(number_of(f"Foot({each.body!r})", each.body, names) for each in feet)
        foot_names = foot_names_of(feet)
        legs = [each.body if each.leg is None else each.leg for each in feet]
        angles = tuple(angle_of_part(part, parents, names) for part in joints)
        twins: list[Indices | None] = [None, None, None]
        if mirror:
            twin = body_twins(names, parents, bodies, mirror)
            twins = [twin, foot_twins(at_feet, legs, twin, feet), joint_twins(angles, twin, joints)]
        pieces: list[Body | Foot | AbstractJointPart] = []
        places = [
            _share(group, pair, pieces)
            for group, pair in zip((bodies, feet, joints), twins, strict=True)
        ]
        couplings = [(k, angles[k]) for k, part in enumerate(joints) if isinstance(part, Coupling)]
        unique_legs = tuple(dict.fromkeys(legs))
        self.root_mass = root_mass
        self.pieces = tuple(pieces)
        self.structure = Structure(
            root=root,
            bodies=tuple(names),
            parents=parents,
            feet=at_feet,
            foot_names=foot_names,
            legs=unique_legs,
            leg_of_foot=tuple(unique_legs.index(leg) for leg in legs),
            joints=angles,
            fixed=fixed_angles(couplings, names),
            body_twins=twins[0],
            foot_twins=twins[1],
            joint_twins=twins[2],
            body_pieces=places[0],
            foot_pieces=places[1],
            joint_pieces=places[2],
            turn=turn_of(turn, names),
        )

    def __check_init__(self) -> None:
        check_parameters(self)
        _check_parameter_names(self)
        check_inertia(self)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies, mirror images with the same leaves."""
        s = self.structure
        parents = (None if p < 0 else s.bodies[p] for p in s.parents)
        return tuple(
            _placed(self.pieces[k], name=name, parent=parent)
            for k, name, parent in zip(s.body_pieces, s.bodies, parents, strict=True)
        )

    @property
    def feet(self) -> tuple[Foot, ...]:
        """All feet, mirror images with the same leaves."""
        s = self.structure
        return tuple(
            _placed(self.pieces[k], body=s.bodies[j], name=name, leg=s.legs[leg])
            for k, j, name, leg in zip(
                s.foot_pieces, s.feet, s.foot_names, s.leg_of_foot, strict=True
            )
        )

    @property
    def joints(self) -> tuple[AbstractJointPart, ...]:
        """What acts at joints; the angle of each is in `structure.joints`."""
        return tuple(self.pieces[k] for k in self.structure.joint_pieces)  # type: ignore[misc]

    @property
    def total_mass(self) -> Scalar:
        """Mass of all bodies and the root point [kg]."""
        masses = [body.mass for body in self.bodies]
        if self.root_mass is not None:
            masses.append(self.root_mass)
        found: Scalar = by_numpy(lambda _, *each: sum(each[1:], each[0]), *masses)
        return found

    @property
    def height(self) -> Scalar:
        """Height of the root point with all angles 0 and the lowest foot on the ground [m]."""
        bodies, heights = self.bodies, []
        for j, foot in zip(self.structure.feet, self.feet, strict=True):
            below = foot.centre.along if foot.radius is None else foot.centre.along + foot.radius
            for k in self.structure.chains[j]:
                at = bodies[k].at
                below = below if at is None else below + at.along
            heights.append(below)
        highest = heights[0]
        for each in heights[1:]:
            highest = jnp.where(each > highest, each, highest)
        return highest

    def parameter_names(self) -> tuple[str, ...]:
        """Names of the leaves, in their order: "thigh.mass", "shank.foot.radius", "hip.mass"."""
        paths = [path for path, _ in jtu.tree_flatten_with_path(self)[0]]
        prefixes = self._prefixes()
        return tuple(
            f"{self.structure.root}.mass"
            if path[0].name == "root_mass"
            else ".".join([prefixes[path[1].idx], _leaf_name(path[2:])])
            for path in paths
        )

    def _prefixes(self) -> dict[int, str]:
        """What names of each piece's parameters begin with."""
        s, found = self.structure, {}
        names = [
            name
            if s.body_twins is None or s.body_twins[j] == j
            else pair_name(*(s.bodies[i] for i in sorted((j, s.body_twins[j]))))
            for j, name in enumerate(s.bodies)
        ]
        for k, name in zip(s.body_pieces, names, strict=True):
            found[k] = name
        for k, j, name in zip(s.foot_pieces, s.feet, s.foot_names, strict=True):
            found[k] = f"{names[j]}.{name}"
        for k, angle, part in zip(s.joint_pieces, s.joints, self.joints, strict=True):
            found[k] = f"{names[angle.weights[0][0]]}.{part.name or part.kind}"
        return found


def _leaf_name(path: tuple[Any, ...]) -> str:
    """The name of a leaf of a piece: "centre" and "centre_ahead" of a point, "K" of a law."""
    names = [str(getattr(key, "name", getattr(key, "idx", key))) for key in path]
    if len(names) > 1 and names[1] in ("along", "ahead"):
        return names[0] if names[1] == "along" else f"{names[0]}_ahead"
    return names[-1]


def _check_parameter_names(mechanism: "Mechanism") -> None:
    """Raises `ArgumentError` where two parameters would have one name."""
    structure, prefixes = mechanism.structure, mechanism._prefixes()
    for k, own in zip(structure.body_pieces, structure.bodies, strict=True):
        called = prefixes[k]
        if called != own and called in structure.bodies:
            raise ArgumentError(
                f"a body is called {called!r}, which is not allowed: in names of parameters "
                f"{called!r} stands for the pair."
            )
    for k, part in zip(structure.joint_pieces, mechanism.joints, strict=True):
        if list(prefixes.values()).count(prefixes[k]) > 1:
            raise ArgumentError(
                f"two {part.kind}s at one body, {prefixes[k]!r}, are not allowed without a name "
                "each: give name=."
            )


def _share(group: Sequence[Any], twins: Indices | None, pieces: list[Any]) -> Indices:
    """Adds the pieces of a group that have parameters of their own; the number of each one's."""
    found: list[int] = []
    for k, piece in enumerate(group):
        if twins is not None and twins[k] < k:
            found.append(found[twins[k]])
            continue
        found.append(len(pieces))
        pieces.append(piece)
    return tuple(found)


def _placed(piece: Any, **names: object) -> Any:
    """A piece with other names and the same leaves, unchecked."""
    placed = copy.copy(piece)
    for name, value in names.items():
        object.__setattr__(placed, name, value)
    return placed

"""Mechanisms: any planar tree of rigid bodies on round feet, given as data."""

import contextlib
import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._jax_versions import current_trace
from jaxbiped._parameter_declaration import check_parameters, parameter, with_fields
from jaxbiped._summary import in_short
from jaxbiped._types import Parameter, Scalar, by_numpy, is_traced
from jaxbiped.caching._caches import OfObjects, OncePerVersion
from jaxbiped.scene._bodies import Body, Foot
from jaxbiped.scene._joint_parts import AbstractJointPart, Coupling, Motor, Stop
from jaxbiped.scene._mechanism_pieces import (
    angle_of_part,
    check_parameter_names,
    check_pieces,
    check_state_names,
    fixed_angles,
    foot_names_of,
    mechanism_parameter_names,
    named_angle,
    number_of,
    parents_of,
)
from jaxbiped.scene._motor_motion import check_images
from jaxbiped.scene._placement import check_zero_pose
from jaxbiped.scene._structure import Indices, Structure
from jaxbiped.scene._symmetry import (
    body_twins,
    check_nothing_turns_along,
    check_same_both_ways,
    foot_twins,
    joint_twins,
    symmetric_part,
    turn_of,
    turned_foot,
    with_turning_body,
)


class Mechanism(eqx.Module):
    """A planar tree of rigid bodies on round feet; a frozen pytree of its parameters.

    Bodies hang by hinges on a root point or on one another. With a `mirror`, the two halves are
    each other's images. They share their parameters, so a derivative is with respect to both, and a
    cycle of the walk is a step.

    Args:
        root: name of the root point, such as "hip"; in states, its place is then `hip_x`, `hip_z`.
        root_mass: point mass at the root point [kg]; None for none.
        bodies: the bodies, parents before children.
        feet: their feet, at least one.
        joints: springs, stops, latches, couplings and motors at joints (`Spring`, `Stop`, `Latch`,
            `Coupling`, `Motor`).
        mirror: pairs of bodies: the one that swings at the beginning of a cycle, then the one that
            stands.
        turn: `{body: N}` for a body that, with its feet, looks the same after an N-th of a turn;
            its feet share their parameters.

    Attributes:
        root_mass: see above.
        pieces: bodies, feet and joint parts with parameters of their own; one of each mirrored
            pair.
        structure: how the pieces are connected.

    Raises:
        ArgumentError: a name is not unique or not known, `mirror` or `turn` is not a symmetry,
            couplings repeat each other, or a motion has no inertia.
    """

    root_mass: Parameter | None = parameter(
        "mass of the root point", "", "kg", minimum=0.0, default=None
    )
    pieces: tuple[Body | Foot | AbstractJointPart, ...] = eqx.field(kw_only=True)
    structure: Structure = eqx.field(static=True, kw_only=True)
    __repr__ = in_short

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
            own = zip(twins[2] or (), angles, strict=True)
            mirrored = [
                k == m and a.mirrored(twin).is_like(a.reversed()) for k, (m, a) in enumerate(own)
            ]
            joints = [symmetric_part(p) if m else p for p, m in zip(joints, mirrored, strict=True)]
        turns, shared = turn_of(turn, names, at_feet), [*twins]
        if turns is not None:
            bodies = with_turning_body(turns, bodies, feet, legs)
            shared[1] = turns.firsts
        pieces: list[Body | Foot | AbstractJointPart] = []
        places = [_share(*g, pieces) for g in zip((bodies, feet, joints), shared, strict=True)]
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
            joint_names=tuple(part.name for part in joints),
            fixed=fixed_angles(couplings, names),
            body_twins=twins[0],
            foot_twins=twins[1],
            joint_twins=twins[2],
            body_pieces=places[0],
            foot_pieces=places[1],
            joint_pieces=places[2],
            turn=turns,
            pairs=tuple((names.index(swings), names.index(stands)) for swings, stands in mirror),
        )
        check_state_names(self.structure)

    def __check_init__(self) -> None:
        check_parameters(self)
        check_parameter_names(self)
        for k, part in enumerate(self.joints):
            if self.structure.changes_sign(k):
                check_same_both_ways(part)
                if isinstance(part, Stop):
                    part.__check_init__()  # its lower limit follows from the upper one
        check_nothing_turns_along(self.structure, self.joints)
        with jax.ensure_compile_time_eval():  # known numbers stay known under a transformation
            check_zero_pose(self)
        check_images(self)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies; mirror images have the same leaves."""
        s = self.structure
        parents = (None if p < 0 else s.bodies[p] for p in s.parents)
        return tuple(
            with_fields(self.pieces[k], name=name, parent=parent)
            for k, name, parent in zip(s.body_pieces, s.bodies, parents, strict=True)
        )

    @property
    def feet(self) -> tuple[Foot, ...]:
        """All feet; those that a mirror or a turn maps to each other have the same leaves."""
        s = self.structure
        feet: list[Any] = [self.pieces[k] for k in s.foot_pieces]
        named = zip(feet, s.feet, s.foot_names, s.leg_of_foot, strict=True)
        return tuple(
            turned_foot(s.turn, with_fields(foot, body=s.bodies[j], name=name, leg=s.legs[leg]), k)
            for k, (foot, j, name, leg) in enumerate(named)
        )

    @property
    def joints(self) -> tuple[AbstractJointPart, ...]:
        """All joint parts; mirror images have the same leaves."""
        s, found = self.structure, []
        for k, (own, name) in enumerate(zip(s.joint_pieces, s.joint_names, strict=True)):
            part: Any = with_fields(self.pieces[own], name=name)
            if own in s.joint_pieces[:k]:
                part = with_fields(part, angle=named_angle(s.joints[k], s.bodies))
            if s.changes_sign(k) and isinstance(part, Stop) and part.upper is not None:
                part = with_fields(part, lower=-part.upper)  # the mirror's
            found.append(part)
        return tuple(found)

    def arguments(self) -> dict[str, Any]:
        """Arguments with which the mechanism can be made again, by name."""
        s = self.structure
        joints = [
            with_fields(part, angle=named_angle(angle, s.bodies))
            for part, angle in zip(self.joints, s.joints, strict=True)
        ]
        mirrored = s.pairs if s.body_twins is not None else ()
        return {
            "root": s.root,
            "root_mass": self.root_mass,
            "bodies": self.bodies,
            "feet": self.feet,
            "joints": tuple(joints),
            "mirror": tuple((s.bodies[i], s.bodies[j]) for i, j in mirrored),
            "turn": None if s.turn is None else {s.bodies[s.turn.body]: s.turn.order},
        }

    def untied(self) -> "Mechanism":
        """The mechanism without its mirror: each side has its own parameters, initially equal."""
        alone = Mechanism(**self.arguments() | {"mirror": ()})
        structure = dataclasses.replace(alone.structure, pairs=self.structure.pairs)
        return with_fields(alone, structure=structure)

    @property
    def has_motors(self) -> bool:
        """Whether motors act at joints."""
        return any(isinstance(part, Motor) for part in self.joints)

    @property
    def total_mass(self) -> Scalar:
        """Mass of all bodies and the root point [kg]."""
        masses = [body.mass for body in self.bodies]
        if self.root_mass is not None:
            masses.append(self.root_mass)
        return by_numpy(lambda _, *each: sum(each[1:], each[0]), *masses)

    @property
    def height(self) -> Scalar:
        """Height of the root point with all angles 0 and the lowest foot on the ground [m]."""
        return self.height_over_feet(1.0)

    def height_over_feet(self, share: float) -> Scalar:
        """Height of the root point above the lowest foot with all angles 0 [m].

        What lies between the root point and the centre of the foot's circle counts by a share.
        """
        bodies, twins, heights = self.bodies, self.structure.foot_twins, []
        for k, (j, foot) in enumerate(zip(self.structure.feet, self.feet, strict=True)):
            if twins is not None and twins[k] < k:
                continue  # as high as its mirror image
            chain = (bodies[i].at for i in self.structure.chains[j])
            parts = [foot.centre.along, *(at.along for at in chain if at is not None)]
            radius = () if foot.radius is None else (foot.radius,)
            heights.append(by_numpy(functools.partial(_height, share, len(parts)), *parts, *radius))
        return by_numpy(lambda numpy, *each: functools.reduce(numpy.maximum, each), *heights)

    def parameter_names(self) -> tuple[str, ...]:
        """Names of the leaves, in their order: "thigh.mass", "shank.foot.radius", "hip.mass"."""
        return mechanism_parameter_names(self)


def _height(share: float, count: int, _: Any, *lengths: Any) -> Any:
    below = sum(lengths[1:count], lengths[0]) * share
    return below + lengths[count] if len(lengths) > count else below


def mechanism_of(walker: Any) -> Mechanism:
    """The mechanism that a walker is, or makes by its method `mechanism()`.

    Raises:
        ArgumentError: what is neither, or makes something else.
    """
    if isinstance(walker, Mechanism):
        return walker
    makes = getattr(walker, "mechanism", None)
    if not isinstance(walker, eqx.Module) or not callable(makes):
        raise ArgumentError(
            f"walker = {walker!r} is not allowed: give a Mechanism, or a module with a method "
            "mechanism() that makes one."
        )
    # What is made within one trace means nothing in another.
    _, once = _MADE(walker, lambda: OncePerVersion(jax.tree.structure(walker)))()
    made, traced = once(dict), is_traced(walker)
    trace = current_trace() if traced else None
    if trace not in made:
        # The walker's own rules first: they name its fields, and its leaves may be new to them.
        getattr(walker, "__check_init__", lambda: None)()
        with contextlib.nullcontext() if traced else jax.ensure_compile_time_eval():
            mechanism = makes()
        check_type(f"{type(walker).__name__}.mechanism()", mechanism, Mechanism)
        made[trace] = mechanism
    return made[trace]


_MADE = OfObjects[OncePerVersion[dict[Any, Mechanism]]]()


def _share(group: Sequence[Any], twins: Indices | None, pieces: list[Any]) -> Indices:
    """Adds the pieces of a group that have parameters of their own; the number of each one's."""
    numbers: list[int] = []
    for k, piece in enumerate(group):
        first = k if twins is None else min(twins[k], k)
        numbers.append(len(pieces) if first == k else numbers[first])
        if first == k:
            pieces.append(piece)
    return tuple(numbers)

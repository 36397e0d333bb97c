"""Symmetries of a mechanism: what a mirror or a turn takes to each other, and what is none."""

import cmath
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._parameter_declaration import with_fields
from jaxbiped._types import by_numpy, is_traced
from jaxbiped.scene._bodies import Body, Foot, OwnHinge, Point
from jaxbiped.scene._joint_parts import AbstractJointPart, Coupling, Latch, Motor, Spring, Stop
from jaxbiped.scene._mechanism_pieces import number_of
from jaxbiped.scene._structure import Angle, Indices, Structure, Turn

_NAMING = {"name", "body", "parent", "leg", "angle"}
"""Fields that place a piece, in which mirror images differ."""


def body_twins(
    names: Sequence[str], parents: Indices, bodies: Sequence[Any], pairs: Iterable[Any]
) -> Indices:
    """Number of each body's mirror image.

    Raises:
        ArgumentError: what is no pair of bodies, or no symmetry of the tree.
    """
    twin = list(range(len(names)))
    if isinstance(pairs, str) or not isinstance(pairs, Iterable):
        raise ArgumentError(f"mirror = {pairs!r} is not allowed: give pairs of bodies.")
    for pair in pairs:
        if not isinstance(pair, tuple | list) or len(pair) != 2 or pair[0] == pair[1]:
            raise ArgumentError(
                f"mirror has {pair!r}, which is not allowed: give pairs of bodies, first the one "
                "that swings and then the one that stands."
            )
        one, other = (number_of("mirror", name, names) for name in pair)
        if twin[one] != one or twin[other] != other:
            raise ArgumentError(f"mirror = {pair!r} is not allowed: a body stands in two pairs.")
        twin[one], twin[other] = other, one
    for j, parent in enumerate(parents):
        image = -1 if parent < 0 else twin[parent]
        if parents[twin[j]] != image:
            raise ArgumentError(
                f"mirror leaves out {names[j]!r}, which hangs on one side: give it a twin."
                if twin[j] == j
                else f"mirror pairs {names[j]!r} with {names[twin[j]]!r}, which do not hang on "
                "each other's images: a mirror must be a symmetry of the tree."
            )
        check_alike(bodies[j], bodies[twin[j]])
    return tuple(twin)


def foot_twins(feet: Indices, legs: Sequence[str], twin: Indices, pieces: Sequence[Any]) -> Indices:
    """Number of each foot's mirror image; feet of paired bodies pair in order.

    Raises:
        ArgumentError: feet that differ in number or size, or a leg on both sides of the mirror.
    """
    found = list(range(len(feet)))
    for body in sorted(set(feet)):
        if twin[body] == body:
            continue
        own, others = ([k for k, j in enumerate(feet) if j == of] for of in (body, twin[body]))
        if len(own) != len(others):
            raise ArgumentError(
                f"mirror pairs bodies with {len(own)} and {len(others)} feet, which is not "
                "allowed: they must have as many."
            )
        for k, other in zip(own, others, strict=True):
            check_alike(pieces[k], pieces[other])
            found[k] = other
    for leg in dict.fromkeys(legs):
        members = [k for k, name in enumerate(legs) if name == leg]
        images, moved = {legs[found[k]] for k in members}, {found[k] != k for k in members}
        if len(images) > 1 or (images == {leg} and moved != {False}):
            raise ArgumentError(
                f"leg = {leg!r} is not allowed: it has feet on both sides of the mirror."
            )
    return tuple(found)


def joint_twins(
    joints: Sequence[Angle], twin: Indices, parts: Sequence[AbstractJointPart]
) -> Indices:
    """Number of each joint part's mirror image; a motor by role has none but itself.

    Raises:
        ArgumentError: a part without an equal one on the other side, or one on an angle that
            changes its sign and that is not the same both ways.
    """
    found = list(range(len(parts)))
    for k, (angle, part) in enumerate(zip(joints, parts, strict=True)):
        image = angle.mirrored(twin)
        if image.is_like(angle) or _is_by_role(part):
            continue
        same = [
            i
            for i, other in enumerate(parts)
            if type(other) is type(part)
            and not _is_by_role(other)
            and _given(other) == _given(part)
            and joints[i].is_like(image)
            and found[i] in (i, k)
        ]
        if same:
            found[k] = same[0]
            check_alike(part, parts[same[0]])
        elif image.is_like(angle.reversed()):
            check_same_both_ways(part)
        else:
            raise ArgumentError(
                f"{type(part).__name__}({_words(part)}) has no counterpart on the other side of "
                "the mirror: give one there, or leave the mirror out."
            )
    return tuple(found)


def _given(part: AbstractJointPart) -> list[str]:
    """What of a part's parameters is given."""
    return [name for name in part.__dataclass_fields__ if getattr(part, name) is not None]


def _is_by_role(part: AbstractJointPart) -> bool:
    return isinstance(part, Motor) and part.by == "role"


def check_alike(one: Any, other: Any) -> None:
    """Raises `ArgumentError` where two mirror images are known to differ."""
    if one is other:
        return
    words = f"{type(one).__name__}({_words(one)}) and {type(other).__name__}({_words(other)})"
    if type(one) is not type(other):
        raise ArgumentError(f"mirror pairs {words}, which are not of one kind.")
    for name in one.__dataclass_fields__:
        if name not in _NAMING and not _equal(getattr(one, name), getattr(other, name)):
            raise ArgumentError(
                f"mirror pairs {words}, whose {name} differ: leave the mirror out for unlike "
                "legs, whose cycle is a stride."
            )


def _equal(one: Any, other: Any) -> bool:
    """Whether two values are the same; what is traced is taken to be."""
    leaves, others = jtu.tree_leaves(one), jtu.tree_leaves(other)
    structure: Any = jtu.tree_structure(one)
    if structure != jtu.tree_structure(other):
        return False
    pairs = zip(leaves, others, strict=True)
    return all(is_traced(pair) or np.array_equal(*pair) for pair in pairs)


_DETERMINED: dict[type, str] = {Spring: "rest", Coupling: "rest", Latch: "at", Stop: "lower"}
"""What a mirror determines of a part on an angle that changes its sign: 0, but for a stop's limit,
which is minus the upper one."""


def symmetric_part(part: Any) -> Any:
    """A part on an angle that changes its sign, with the parameters that the mirror leaves free."""
    name = _DETERMINED.get(type(part))
    return part if name is None else with_fields(part, **{name: None})


def check_same_both_ways(part: AbstractJointPart) -> None:
    """Raises `ArgumentError` where a part on an angle that changes sign is not its own image."""
    if isinstance(part, Stop):
        if not _equal(part.upper, jtu.tree_map(lambda limit: -limit, part.lower)):
            raise ArgumentError(
                f"Stop({_words(part)}) has an angle that changes its sign in the mirror: lower "
                "must be minus upper."
            )
    elif name := _DETERMINED.get(type(part)):
        value = getattr(part, name)
        if value is not None and not is_traced(value) and np.any(value):
            raise ArgumentError(
                f"{name} = {value} is not allowed for {type(part).__name__}({_words(part)}), whose "
                "angle changes its sign in the mirror: it must be 0."
            )
    if isinstance(part, Motor) and not _is_by_role(part):
        raise ArgumentError(
            f"Motor({_words(part)}, by='side') has an angle that changes its sign in the mirror: "
            "give it by role, or leave the mirror out."
        )


def _words(piece: Any) -> str:
    """What distinguishes a piece from others of its kind."""
    own = getattr(piece, "body", None) or getattr(piece, "angle", None) or piece.name
    return repr(own if isinstance(own, str) else dict(own))


def turn_of(turn: Mapping[str, int] | None, names: list[str], feet: Indices) -> Turn | None:
    """A rotational symmetry, from a body and its count; `feet` are numbers of the feet's bodies.

    Raises:
        ArgumentError: no body and count, or feet that cannot be as many at each place.
    """
    if turn is None:
        return None
    if not isinstance(turn, Mapping) or len(turn) != 1:
        raise ArgumentError(f"turn = {turn!r} is not allowed: give one body and its count.")
    ((name, count),) = turn.items()
    if not isinstance(count, int) or count < 3:
        raise ArgumentError(
            f"turn = {dict(turn)} is not allowed: the count must be a whole number of at least 3."
        )
    body = number_of("turn", name, names)
    own = [k for k, j in enumerate(feet) if j == body]
    if not own or len(own) % count:
        raise _moved(count)
    size = len(own) // count
    firsts, places = list(range(len(feet))), [0] * len(feet)
    for i, k in enumerate(own):
        firsts[k], places[k] = own[i % size], i // size
    return Turn(body, count, tuple(firsts), tuple(places))


def _moved(count: int) -> ArgumentError:
    return ArgumentError(
        f"turn = {count} is not allowed: turned by 1/{count} of a turn the body's feet are not "
        "where they were, each where the next one was: list them in this order."
    )


def check_nothing_turns_along(structure: Structure, joints: Sequence[AbstractJointPart]) -> None:
    """Raises `ArgumentError` for what hangs or acts on a body and a turn would change."""
    turn = structure.turn
    if turn is None:
        return
    name, told = structure.bodies[turn.body], f"turn = {turn.order} is not allowed"
    if structure.children[turn.body]:
        raise ArgumentError(
            f"{told}: a body on {name!r} would not be where it was; hang it on {structure.root!r}."
        )
    for angle, part in zip(structure.joints, joints, strict=True):
        damps = isinstance(part, Motor) or (isinstance(part, Spring) and part.stiffness is None)
        if turn.body in dict(angle.weights) and not damps:
            raise ArgumentError(
                f"{told}: after 1/{turn.order} of a turn a {type(part).__name__} on {name!r} would "
                "not act as before; leave it out."
            )


def with_turning_body(
    turn: Turn, bodies: Sequence[Body], feet: Sequence[Foot], legs: Sequence[str]
) -> list[Body]:
    """The bodies, of which a turn leaves one's parameters free but its mass centre, its hinge.

    Raises:
        ArgumentError: a body that is known to differ after a turn; not what is traced.
    """
    freed = [*bodies]
    freed[turn.body] = with_fields(bodies[turn.body], centre=OwnHinge())
    own = [k for k, place in enumerate(turn.places) if place or k in turn.firsts[k + 1 :]]
    by_place = [{legs[k] for k in own if turn.places[k] == p} for p in range(turn.order)]
    if any(len(each) > 1 for each in by_place) or len(set.union(*by_place)) < turn.order:
        raise ArgumentError(
            f"turn = {turn.order} is not allowed with the legs {', '.join(dict.fromkeys(legs))}: "
            "the feet at each place must be a leg of their own; give them leg=."
        )
    body = bodies[turn.body]
    if is_traced((body, feet)):
        return freed
    if _number(body.centre):
        raise ArgumentError(
            f"turn is not allowed for Body({body.name!r}), whose mass centre lies off its hinge: "
            "give centre=0."
        )
    for k in own:
        first, place = feet[turn.firsts[k]], turn.places[k]
        turned = _number(first.centre) * _rotation(turn, place)
        same = abs(turned - _number(feet[k].centre)) <= 1e-9 * abs(turned)
        if not same or first.radius != feet[k].radius:
            raise _moved(turn.order)
    return freed


def _number(point: Point) -> complex:
    return complex(point.along, 0.0 if point.ahead is None else point.ahead)


def _rotation(turn: Turn, place: int) -> complex:
    return cmath.rect(1.0, 2.0 * cmath.pi * place / turn.order)


def turned_foot(turn: Turn | None, foot: Foot, number: int) -> Foot:
    """A foot at its own place, from the one at the first place."""
    if turn is None or not turn.places[number]:
        return foot
    turned = _rotation(turn, turn.places[number])
    cosine, sine = turned.real, turned.imag
    along, ahead = foot.centre.along, foot.centre.ahead
    given = (along,) if ahead is None else (along, ahead)
    places = by_numpy(lambda _, a, b=0.0: (cosine * a - sine * b, cosine * b + sine * a), *given)
    return with_fields(foot, centre=Point(*places))

"""Turns of a mechanism: a body that looks the same, its feet too, after a part of a turn."""

import cmath
import math
from collections.abc import Mapping, Sequence

from jaxbiped._checks import ArgumentError
from jaxbiped._parameter_declaration import with_fields
from jaxbiped._types import by_numpy, is_traced
from jaxbiped.scene._bodies import Body, Foot, OwnHinge, Point
from jaxbiped.scene._joint_parts import AbstractJointPart, Motor, Spring
from jaxbiped.scene._mechanism_pieces import number_of
from jaxbiped.scene._structure import Indices, Structure, Turn


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


def check_turn(
    turn: Turn, bodies: Sequence[Body], feet: Sequence[Foot], legs: Sequence[str]
) -> None:
    """Raises `ArgumentError` where a body is known to differ after a turn.

    What is traced is taken to be alike.
    """
    own = [k for k, place in enumerate(turn.places) if place or k in turn.firsts[k + 1 :]]
    by_place = [{legs[k] for k in own if turn.places[k] == p} for p in range(turn.order)]
    if any(len(each) > 1 for each in by_place) or len(set.union(*by_place)) < turn.order:
        raise ArgumentError(
            f"turn = {turn.order} is not allowed with the legs {', '.join(dict.fromkeys(legs))}: "
            "the feet at each place must be a leg of their own; give them leg=."
        )
    body = bodies[turn.body]
    if is_traced((body, feet)):
        return
    if _number(body.centre):
        raise ArgumentError(
            f"turn is not allowed for Body({body.name!r}), whose mass centre lies off its hinge: "
            "give centre=0."
        )
    for k in own:
        first, place = feet[turn.firsts[k]], turn.places[k]
        turned = _number(first.centre) * cmath.rect(1.0, _angle(turn, place))
        same = abs(turned - _number(feet[k].centre)) <= 1e-9 * abs(turned)
        if not same or first.radius != feet[k].radius:
            raise _moved(turn.order)


def _number(point: Point) -> complex:
    return complex(point.along, 0.0 if point.ahead is None else point.ahead)


def _angle(turn: Turn, place: int) -> float:
    return 2.0 * math.pi * place / turn.order


def turning_body(body: Body) -> Body:
    """A body with the parameters that a turn leaves free: its mass centre is its hinge."""
    changed: Body = with_fields(body, centre=OwnHinge())
    return changed


def turned_foot(turn: Turn | None, foot: Foot, number: int) -> Foot:
    """A foot at its own place, from the one at the first place."""
    if turn is None or not turn.places[number]:
        return foot
    angle = _angle(turn, turn.places[number])
    cosine, sine = math.cos(angle), math.sin(angle)
    along, ahead = foot.centre.along, foot.centre.ahead
    if ahead is None:
        places = by_numpy(lambda _, a: (cosine * a, sine * a), along)
    else:
        turn_point = lambda _, a, b: (cosine * a - sine * b, cosine * b + sine * a)  # noqa: E731
        places = by_numpy(turn_point, along, ahead)
    changed: Foot = with_fields(foot, centre=Point(*places))
    return changed

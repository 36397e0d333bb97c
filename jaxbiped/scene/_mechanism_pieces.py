"""Pieces of a mechanism, checked and numbered: what hangs on what, and which angle a part is on."""

import string
from collections.abc import Sequence
from typing import Any

import equinox as eqx

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped.scene._bodies import RESERVED, Body, Foot
from jaxbiped.scene._joint_parts import AbstractJointPart
from jaxbiped.scene._structure import Angle, Indices, Structure


def check_pieces(root: str, bodies: Any, feet: Any, joints: Any) -> None:
    """Raises `ArgumentError` for pieces of the wrong kind, no foot, or a name that stands twice."""
    for argument, kind, group in (
        ("bodies", Body, bodies), ("feet", Foot, feet), ("joints", AbstractJointPart, joints)
    ):  # fmt: skip
        if isinstance(group, eqx.Module) or not isinstance(group, Sequence):
            raise ArgumentError(f"{argument} = {group!r} is not allowed: give a tuple of them.")
        for each in group:
            check_type(argument, each, kind)
    for argument, one, group in (("bodies", "body", bodies), ("feet", "foot", feet)):
        if not group:
            raise ArgumentError(
                f"{argument} is empty, which is not allowed: a mechanism needs at least one {one}."
            )
    if root[0] not in string.ascii_letters:
        raise ArgumentError(
            f"root = {root!r} is not allowed: it must begin with a letter, because names of "
            "states do."
        )
    names = [each.name for each in bodies]
    for name in names:
        if names.count(name) > 1 or name == root:
            raise ArgumentError(
                f"two parts are called {name!r}, which is not allowed: names are unique."
            )


def check_state_names(structure: Structure) -> None:
    """Raises `ArgumentError` where two scalars of a state would have one name."""
    names = (*structure.coordinates, *structure.rates, *structure.bristles)
    for name in names:
        if names.count(name) > 1:
            raise ArgumentError(
                f"two scalars of the state would be called {name!r}, which is not allowed: give "
                "the root, a body or a foot another name."
            )


def number_of(part: str, name: Any, names: Sequence[str]) -> int:
    """The number of a body by its name; `part` says in a refusal who names it."""
    if name not in names:
        raise ArgumentError(
            f"{part} names {name!r}, which is not a body: there are {', '.join(names)}."
        )
    return names.index(name)


def parents_of(bodies: Sequence[Body], names: list[str]) -> Indices:
    """The number of each body's parent, −1 for the root point."""
    found = []
    for j, body in enumerate(bodies):
        if body.parent is None:
            found.append(-1)
            continue
        parent = number_of(f"Body({body.name!r})", body.parent, names)
        if parent >= j:
            raise ArgumentError(
                f"Body({body.name!r}) stands before its parent {body.parent!r}: parents come first."
            )
        found.append(parent)
    return tuple(found)


def foot_names_of(feet: Sequence[Foot]) -> tuple[str, ...]:
    """The name of each foot, its own or "foot", numbered where a body has several."""
    of_body = [each.body for each in feet]
    found: list[str] = []
    for k, foot in enumerate(feet):
        several = of_body.count(foot.body) > 1
        plain = f"foot_{of_body[: k + 1].count(foot.body)}" if several else "foot"
        name = plain if foot.name is None else foot.name
        if (foot.body, name) in zip(of_body, found, strict=False):
            raise ArgumentError(
                f"two feet of {foot.body!r} are called {name!r}, which is not allowed."
            )
        found.append(name)
    return tuple(found)


def angle_of_part(part: AbstractJointPart, parents: Indices, names: Sequence[str]) -> Angle:
    return named_sum(f"{type(part).__name__} on {part.angle!r}", part.angle, parents, names)


def named_sum(words: str, angle: Any, parents: Indices, names: Sequence[str]) -> Angle:
    """An angle as a sum of bodies' angles: of a name, or of weights by name."""
    if isinstance(angle, str):
        j = number_of(words, angle, names)
        reaction = () if parents[j] < 0 else ((parents[j], -1.0),)
        return Angle(((j, 1.0), *reaction))
    weights, vertical = [], 0.0
    for name, weight in dict(angle).items():
        if name == "vertical":
            vertical = float(weight)
        elif name not in RESERVED:
            weights.append((number_of(words, name, names), float(weight)))
    if not weights:
        raise ArgumentError(f"{words} names no body, so nothing would move.")
    return Angle(tuple(weights), vertical)


def named_angle(angle: Angle, names: Sequence[str]) -> tuple[tuple[str, float], ...]:
    """An angle as weights by name, the slope's normal as the other side where they need one."""
    weights = [(names[i], weight) for i, weight in angle.weights]
    weights += [("vertical", angle.vertical)] * bool(angle.vertical)
    total = sum(weight for _, weight in weights)
    return (*weights, *([("normal", -total)] if abs(total) > 1e-12 else []))

"""Pieces of a mechanism, checked, numbered and named, and its couplings solved.

What hangs on what, which angle a part is on, and what its parameters are called: "thigh.mass",
"shank.foot.radius".
"""

import functools
import string
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped.scene._bodies import RESERVED, Body, Foot, check_name
from jaxbiped.scene._joint_parts import AbstractJointPart
from jaxbiped.scene._structure import Angle, Fixed, Indices, Structure, pair_name, weighted

if TYPE_CHECKING:
    from jaxbiped.scene._mechanism import Mechanism


def check_pieces(root: str, bodies: Any, feet: Any, joints: Any) -> None:
    """Raises `ArgumentError` for pieces of the wrong kind, no foot, or a name that stands twice."""
    check_name("root", root)
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


def mechanism_parameter_names(mechanism: "Mechanism") -> tuple[str, ...]:
    """Names of a mechanism's leaves, in their order."""
    prefixes = _prefixes(mechanism)
    return tuple(
        f"{mechanism.structure.root}.mass"
        if path[0].name == "root_mass"
        else f"{prefixes[path[1].idx]}.{_leaf_name(path[2:])}"
        for path, _ in jtu.tree_flatten_with_path(mechanism)[0]
    )


def _prefixes(mechanism: "Mechanism") -> dict[int, str]:
    """What names of each piece's parameters begin with."""
    s, found = mechanism.structure, {}
    names = [
        name
        if s.body_twins is None or s.body_twins[j] == j
        else pair_name(*(s.bodies[i] for i in sorted((j, s.body_twins[j]))))
        for j, name in enumerate(s.bodies)
    ]
    tokens = [name for j, name in enumerate(names) if s.body_twins and s.body_twins[j] != j]
    for j, twin in enumerate(s.body_twins or ()):
        if twin != j and tokens.count(names[j]) > 2:  # several pairs share them
            names[j] = "+".join(s.bodies[i] for i in sorted((j, twin)))
    for k, name in zip(s.body_pieces, names, strict=True):
        found[k] = name
    for k, j in zip(s.foot_pieces, s.feet, strict=True):
        own = [name for i, name in zip(s.foot_pieces, s.foot_names, strict=True) if i == k]
        found[k] = f"{names[j]}.{functools.reduce(pair_name, own)}"
    for k, angle, part in zip(s.joint_pieces, s.joints, mechanism.joints, strict=True):
        found.setdefault(k, f"{names[angle.weights[0][0]]}.{part.name or part.kind}")
    return found


def _leaf_name(path: tuple[Any, ...]) -> str:
    """The name of a leaf of a piece: "centre" and "centre_ahead" of a point, "K" of a law."""
    texts = path_texts(path)
    if len(texts) > 1 and texts[1] in ("along", "ahead"):
        return texts[0] if texts[1] == "along" else f"{texts[0]}_ahead"
    return ".".join(texts[1:] if len(texts) > 1 and texts[0] == "law" else texts)


def path_texts(path: tuple[Any, ...]) -> list[str]:
    """Names along a path; an entry of several is numbered from 1."""
    texts: list[str] = []
    for key in path:
        if isinstance(key, jtu.SequenceKey) and texts:
            texts[-1] += f"_{key.idx + 1}"
        else:
            texts.append(str(getattr(key, "name", key)))
    return texts


def check_parameter_names(mechanism: "Mechanism") -> None:
    """Raises `ArgumentError` where two pieces would have parameters of the same names."""
    structure, prefixes = mechanism.structure, _prefixes(mechanism)
    for k, name in zip(structure.body_pieces, structure.bodies, strict=True):
        if prefixes[k] != name and prefixes[k] in structure.bodies:
            raise ArgumentError(
                f"a body is called {prefixes[k]!r}, which is not allowed: in names of parameters "
                f"{prefixes[k]!r} stands for the pair."
            )
    for k, part in zip(structure.joint_pieces, mechanism.joints, strict=True):
        if list(prefixes.values()).count(prefixes[k]) > 1:
            raise ArgumentError(
                f"two {part.kind}s at one body, {prefixes[k]!r}, are not allowed "
                "without a name each: give name=."
            )
    names = mechanism_parameter_names(mechanism)
    for name in names:
        if names.count(name) > 1:
            raise ArgumentError(
                f"two parameters would be called {name!r}, which is not allowed: give bodies, feet "
                "or joints other names."
            )


_SINGULAR = 1e-9
"""Couplings whose weights are so nearly dependent repeat or contradict each other."""


def with_fixed(
    structure: Structure, values: Sequence[Any], vertical: Any = None, joints: Sequence[Any] = ()
) -> list[Any]:
    """Values of all bodies' angles, those that couplings fix set from the others.

    Args:
        structure: of the mechanism.
        values: of all bodies; what stands for fixed ones is not read.
        vertical: angle of the vertical [rad]; None for rates and accelerations.
        joints: the joint parts, whose rest angles count; none for rates and accelerations.
    """
    found = list(values)
    for each in structure.fixed:
        own = each.angle.of(values, vertical)
        own = 0.0 * values[0] if own is None else own
        for k, weight in each.rests if joints else ():
            rest = joints[k].rest
            own = own if rest is None else own + weighted(rest, weight)
        found[each.body] = own
    return found


def fixed_angles(couplings: Sequence[tuple[int, Angle]], names: Sequence[str]) -> tuple[Fixed, ...]:
    """The angle of the first body that each coupling names, as a sum of those that stay free.

    Args:
        couplings: number of each one among the joint parts, and its angle.
        names: of the bodies.

    Raises:
        ArgumentError: an angle that two couplings fix, or couplings that repeat or contradict each
            other.
    """
    if not couplings:
        return ()
    first = [angle.weights[0][0] for _, angle in couplings]
    for body in first:
        if first.count(body) > 1:
            raise ArgumentError(
                f"two couplings name {names[body]!r} first, whose angle each would fix: name "
                "another body first in one of them."
            )
    weights = np.zeros((len(couplings), len(names)))
    for row, (_, angle) in enumerate(couplings):
        for body, weight in angle.weights:
            weights[row, body] = weight
    own = weights[:, first]
    if np.linalg.cond(own) * _SINGULAR > 1.0:
        raise ArgumentError(
            f"couplings of {', '.join(repr(names[body]) for body in first)} repeat or contradict "
            "each other: leave one out."
        )
    by_rest = np.linalg.inv(own)
    by_others = -by_rest @ weights
    by_slope = -by_rest @ np.array([angle.vertical for _, angle in couplings])
    return tuple(
        Fixed(
            body,
            Angle(
                tuple(
                    (j, float(by_others[row, j]))
                    for j in range(len(names))
                    if j not in first and by_others[row, j]
                ),
                float(by_slope[row]),
            ),
            tuple((k, float(by_rest[row, i])) for i, (k, _) in enumerate(couplings)),
        )
        for row, body in enumerate(first)
    )

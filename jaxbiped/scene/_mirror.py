"""The mirror of a mechanism: which pieces are each other's images, and what is no symmetry."""

from collections.abc import Iterable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._parameter_declaration import with_fields
from jaxbiped._types import is_traced
from jaxbiped.scene._joint_parts import AbstractJointPart, Coupling, Latch, Motor, Spring, Stop
from jaxbiped.scene._structure import Angle, Indices

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
        for name in pair:
            if name not in names:
                raise ArgumentError(
                    f"mirror names {name!r}, which is not a body: there are {', '.join(names)}."
                )
        one, other = (names.index(name) for name in pair)
        if twin[one] != one or twin[other] != other:
            raise ArgumentError(f"mirror = {pair!r} is not allowed: a body stands in two pairs.")
        twin[one], twin[other] = other, one
    for j, parent in enumerate(parents):
        image = -1 if parent < 0 else twin[parent]
        if parents[twin[j]] != image:
            left_out = twin[j] == j
            raise ArgumentError(
                f"mirror leaves out {names[j]!r}, which hangs on one side: give it a twin."
                if left_out
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
        own = [k for k, each in enumerate(feet) if each == body]
        others = [k for k, each in enumerate(feet) if each == twin[body]]
        if len(own) != len(others):
            raise ArgumentError(
                f"mirror pairs bodies with {len(own)} and {len(others)} feet, which is not "
                "allowed: they must have as many."
            )
        for k, other in zip(own, others, strict=True):
            check_alike(pieces[k], pieces[other])
            found[k] = other
    for leg in dict.fromkeys(legs):
        images = {legs[found[k]] for k, name in enumerate(legs) if name == leg}
        members = [k for k, name in enumerate(legs) if name == leg]
        moved = {found[k] != k for k in members}
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
        if name in _NAMING:
            continue
        mine, yours = getattr(one, name), getattr(other, name)
        if not _equal(mine, yours):
            raise ArgumentError(
                f"mirror pairs {words}, whose {name} differ: leave the mirror out for unlike "
                "legs, whose cycle is a stride."
            )


def _equal(one: Any, other: Any) -> bool:
    leaves, others = jtu.tree_leaves(one), jtu.tree_leaves(other)
    structure: Any = jtu.tree_structure(one)
    if structure != jtu.tree_structure(other):
        return False
    for a, b in zip(leaves, others, strict=True):
        if is_traced((a, b)):
            continue
        same = np.array_equal(a, b) if eqx.is_array_like(a) else a == b
        if not same:
            return False
    return True


def symmetric_part(part: Any) -> Any:
    """A part on an angle that changes its sign, with the parameters that the mirror leaves free.

    Of a stop's limits one, for the other is its negative; no rest angle, which is 0.
    """
    if isinstance(part, Stop):
        return with_fields(part, lower=None)
    if isinstance(part, Latch):
        return with_fields(part, at=None)
    return with_fields(part, rest=None) if isinstance(part, Spring | Coupling) else part


def whole_part(part: Any) -> Any:
    """A part on an angle that changes its sign, with both limits of a stop."""
    if not isinstance(part, Stop):
        return part
    assert part.upper is not None  # both limits were given
    return with_fields(part, lower=-part.upper)


def check_same_both_ways(part: AbstractJointPart) -> None:
    """Raises `ArgumentError` where a part on an angle that changes sign is not its own image."""
    name = None
    if isinstance(part, Spring | Coupling) and _is_not_zero(part.rest):
        name = "rest"
    elif isinstance(part, Latch) and _is_not_zero(part.at):
        name = "at"
    if name is not None:
        raise ArgumentError(
            f"{name} = {getattr(part, name)} is not allowed for {type(part).__name__}"
            f"({_words(part)}), whose angle changes its sign in the mirror: it must be 0."
        )
    if isinstance(part, Stop) and not _are_opposite(part.lower, part.upper):
        raise ArgumentError(
            f"Stop({_words(part)}) has an angle that changes its sign in the mirror: lower must be "
            "minus upper."
        )
    if isinstance(part, Motor) and not _is_by_role(part):
        raise ArgumentError(
            f"Motor({_words(part)}, by='side') has an angle that changes its sign in the mirror: "
            "give it by role, or leave the mirror out."
        )


def _is_not_zero(value: Any) -> bool:
    return value is not None and not isinstance(value, jax.core.Tracer) and bool(np.any(value))


def _are_opposite(one: Any, other: Any) -> bool:
    if one is None or other is None:
        return False
    if is_traced((one, other)):
        return True
    return bool(np.array_equal(np.asarray(one), -np.asarray(other)))


def _words(piece: Any) -> str:
    """What distinguishes a piece from others of its kind."""
    own = getattr(piece, "body", None) or getattr(piece, "angle", None) or piece.name
    return repr(own if isinstance(own, str) else dict(own))

"""Names and quantities of a mechanism's parameters: "thigh.mass", "shank.foot.radius"."""

import functools
from typing import TYPE_CHECKING, Any

import jax.tree_util as jtu

from jaxbiped._checks import ArgumentError
from jaxbiped.scene._structure import pair_name

if TYPE_CHECKING:
    from jaxbiped.scene._mechanism import Mechanism


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

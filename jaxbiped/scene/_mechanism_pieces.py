"""Pieces of a mechanism, checked and numbered: what hangs on what, and which angle a part is on.

With all angles 0 they must stand above the ground, and every motion must have inertia.
"""

import string
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import is_traced
from jaxbiped.scene._bodies import RESERVED, Body, Foot
from jaxbiped.scene._joint_parts import AbstractJointPart
from jaxbiped.scene._structure import Angle, Indices, Structure

if TYPE_CHECKING:
    from jaxbiped.scene._mechanism import Mechanism


_SINGULAR = 1e-12
"""Least eigenvalue of a mass matrix scaled to a diagonal of ones that still is an inertia."""


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


def check_zero_pose(mechanism: "Mechanism") -> None:
    """Raises `ArgumentError` where the root point is not above the ground with all angles 0.

    Nor may the mass matrix be known to be singular there.

    Hanging straight down, what has no inertia of its own has none at all: a mass at its hinge, a
    massless thigh over a shank that is a mass point, legs without inertia under a massless root.
    """
    if is_traced(mechanism):
        return
    _check_shapes(mechanism)
    height = np.min(np.asarray(mechanism.height))
    if height <= 0.0:
        raise ArgumentError(
            f"feet are not allowed where all angles are 0: the root point is at {height:g} m, not "
            "above the ground; put one foot's sole below it."
        )
    structure = mechanism.structure
    matrix = _mass_matrix(mechanism)
    diagonal = np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    for j, body in enumerate(structure.free):
        if np.any(diagonal[..., 2 + j] == 0.0):
            _refuse(mechanism, body)
    if np.any(diagonal[..., :2] == 0.0):
        raise ArgumentError(
            "bodies and root_mass are all without mass, which is not allowed: give one some mass."
        )
    scaled = matrix / diagonal[..., :, None] / diagonal[..., None, :]
    values, vectors = np.linalg.eigh(scaled)
    if np.any(values[..., 0] < _SINGULAR):
        worst = np.reshape(vectors[..., 2:, 0], (-1, len(structure.free)))
        sizes = np.max(np.abs(worst), axis=0)
        # Of those that turn as much as the first one does, whatever the rounding.
        most = int(np.argmax(sizes > (1.0 - 1e-6) * np.max(sizes)))
        _refuse(mechanism, structure.free[most])


def _check_shapes(mechanism: "Mechanism") -> None:
    """Raises `ArgumentError` where two numbers are arrays that do not broadcast to one shape."""
    known: dict[tuple[int, ...], str] = {}
    leaves = jtu.tree_leaves(mechanism)
    for name, leaf in zip(mechanism.parameter_names(), leaves, strict=True):
        for shape, other in known.items():
            try:
                np.broadcast_shapes(shape, np.shape(leaf))
            except ValueError:
                raise ArgumentError(
                    f"{other} and {name} have the shapes {shape} and {np.shape(leaf)}, which are "
                    "not allowed together: give arrays of one shape."
                ) from None
        known.setdefault(np.shape(leaf), name)


def _refuse(mechanism: "Mechanism", body: int) -> None:
    structure = mechanism.structure
    name = structure.bodies[body]
    mend = "give it some inertia, or put its mass away from its hinge"
    if body in structure.feet and not np.any(mechanism.bodies[body].mass):
        mend = "give it an inertia of 1e-4 kg m^2, or put the foot on the leg"
    raise ArgumentError(
        f"Body({name!r}) can turn without any inertia where all angles are 0, which is not "
        f"allowed: {mend}."
    )


def _mass_matrix(mechanism: "Mechanism") -> np.ndarray:
    """Of the root point's place and the free angles, all angles 0; shape (..., n, n)."""
    structure, bodies = mechanism.structure, mechanism.bodies
    n = len(bodies)
    total: Any = 0.0
    for body, chain in zip(bodies, structure.chains, strict=True):
        moves: Any = np.eye(2, 2 + n)
        for link, after in zip(chain, (*chain[1:], None), strict=True):
            point = body.centre if after is None else bodies[after].at
            if point is None:
                continue
            # At angle 0 a point (along, ahead) moves by (along, ahead) for each radian.
            moves = _added(moves, 0, 2 + link, point.along)
            if point.ahead is not None:
                moves = _added(moves, 1, 2 + link, point.ahead)
        mass = np.asarray(body.mass)[..., None, None]
        total = total + mass * (np.swapaxes(moves, -1, -2) @ moves)
        total = _added(total, 2 + chain[-1], 2 + chain[-1], body.inertia)
    if mechanism.root_mass is not None:
        for i in range(2):
            total = _added(total, i, i, mechanism.root_mass)
    free = np.zeros((2 + n, 2 + len(structure.free)))
    free[0, 0] = free[1, 1] = 1.0
    for k, j in enumerate(structure.free):
        free[2 + j, 2 + k] = 1.0
    for each in structure.fixed:
        for j, weight in each.angle.weights:
            free[2 + each.body, 2 + structure.free.index(j)] = weight
    return np.asarray(free.T @ total @ free)


def _added(matrix: Any, row: int, column: int, value: Any) -> Any:
    """A matrix, or a batch of them, with a value added to one entry of each."""
    value = np.asarray(value, dtype=float)
    shape = np.broadcast_shapes(np.shape(matrix)[:-2], value.shape)
    matrix = np.array(np.broadcast_to(matrix, (*shape, *np.shape(matrix)[-2:])))
    matrix[..., row, column] += value
    return matrix

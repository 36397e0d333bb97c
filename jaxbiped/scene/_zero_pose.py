"""A mechanism with all angles 0: it stands above the ground, and every motion has inertia."""

from typing import TYPE_CHECKING, Any

import jax
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError

if TYPE_CHECKING:
    from jaxbiped.scene._mechanism import Mechanism

_SINGULAR = 1e-12
"""Least eigenvalue of a mass matrix scaled to a diagonal of ones that still is an inertia."""


def check_zero_pose(mechanism: "Mechanism") -> None:
    """Raises `ArgumentError` where the root point is not above the ground with all angles 0.

    Nor may the mass matrix be known to be singular there.

    Hanging straight down, what has no inertia of its own has none at all: a mass at its hinge, a
    massless thigh over a shank that is a mass point, legs without inertia under a massless root.
    """
    if any(isinstance(leaf, jax.core.Tracer) for leaf in jtu.tree_leaves(mechanism)):
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

"""Balance of forces in the free coordinates of a mechanism, and their mass matrix.

The free coordinates are the root point's place and the angles that no coupling fixes. What moves
the others is weighed onto these (virtual work), so that a coupling needs neither a torque nor an
equation.
"""

from collections.abc import Sequence
from typing import TypeAlias

from jaxbiped._types import Scalar
from jaxbiped.dynamics._joint_loads import of_all_bodies
from jaxbiped.dynamics._tree import Loads, Pose
from jaxbiped.dynamics._tree_inertia import Composites, inertial_loads, mass_entries
from jaxbiped.linalg._sparse_lu import Entry, SparseMatrix
from jaxbiped.scene._structure import Structure, weighted


def force_balance(
    structure: Structure,
    known: Composites,
    pose: Pose,
    loads: Loads,
    accelerations: Sequence[Scalar],
) -> list[Scalar]:
    """F − M a of the free coordinates, zero where the accelerations are those under the loads.

    Forces of the motion itself and gravity are not among the loads: accelerations are those in the
    frame that falls freely.
    """
    moved = [*accelerations[:2], *of_all_bodies(structure, accelerations[2:], accelerations[0])]
    inertial = inertial_loads(structure, known, pose, moved)
    shares = fold(free_weights(structure), loads.plus(inertial).entries())
    zero = moved[0] * 0.0
    return [shares.get(row, zero) for row in range(2 + len(structure.free))]


def free_mass_entries(structure: Structure, known: Composites, pose: Pose) -> SparseMatrix:
    """The mass matrix of the free coordinates."""
    return fold_matrix(free_weights(structure), mass_entries(structure, known, pose))


Weights: TypeAlias = Sequence[Sequence[tuple[int, Scalar | float]]]
"""For each coordinate, the rows that move it, with what it moves by for each unit of theirs."""


def free_weights(structure: Structure) -> Weights:
    """The root point's place and each body's angle by the free coordinates, in their order."""
    places = {body: 2 + place for place, body in enumerate(structure.free)}
    of_bodies = {body: [(row, 1.0)] for body, row in places.items()}
    for fixed in structure.fixed:
        of_bodies[fixed.body] = [(places[j], weight) for j, weight in fixed.angle.weights]
    return [[(0, 1.0)], [(1, 1.0)], *(of_bodies[j] for j in range(len(structure.bodies)))]


def fold(weights: Weights, values: Sequence[Entry]) -> dict[int, Scalar]:
    """Generalised forces of all coordinates as those of the rows that move them."""
    found: dict[int, Scalar] = {}
    for value, rows in zip(values, weights, strict=True):
        for row, weight in rows:
            if value is None:
                continue
            own = weighted(value, weight)
            found[row] = found[row] + own if row in found else own
    return found


def fold_matrix(weights: Weights, entries: SparseMatrix) -> SparseMatrix:
    """The mass matrix of all coordinates as that of the rows that move them."""
    found: SparseMatrix = {}

    def add(row: int, column: int, entry: Scalar, weight: Scalar | float) -> None:
        value = weighted(entry, weight)
        found[row, column] = found[row, column] + value if (row, column) in found else value

    for (i, j), entry in entries.items():
        for row, first in weights[i] if i <= j else ():
            for column, second in weights[j]:
                if i == j or row != column:
                    add(row, column, entry, first * second)
                if i != j:
                    twice = 1.0 if row != column else 2.0
                    add(column, row, entry, twice * first * second)
    return found

"""Sparse L U of small matrices, unrolled over scalars and without pivoting.

A matrix is a dictionary of its entries by places (row, column); the others are zero whatever the
state. For the matrices of implicit steps in a tree's own form, which are positive where steps are
short, so that the order of elimination can be that of fewest new entries.
"""

from collections.abc import Mapping
from typing import TypeAlias

import equinox as eqx

from jaxbiped._types import Scalar

Entry: TypeAlias = Scalar | None
"""None: zero whatever the state."""
Place: TypeAlias = tuple[int, int]
SparseMatrix: TypeAlias = dict[Place, Scalar]


def plus(a: Entry, b: Entry) -> Entry:
    if a is None:
        return b
    return a if b is None else a + b


def times(a: Entry, b: Entry) -> Entry:
    return None if a is None or b is None else a * b


class SparseFactors(eqx.Module):
    """L and U of a sparse matrix, their rows in the order of elimination.

    Attributes:
        entries: those of L below the diagonal, whose own is one, and of U above it.
        inverses: of U's diagonal, by row.
        order: of elimination.
    """

    entries: SparseMatrix
    inverses: dict[int, Scalar]
    order: tuple[int, ...] = eqx.field(static=True)

    def solve(self, right: Mapping[int, Entry]) -> dict[int, Entry]:
        """What the inverse takes to a vector, each by row; None for what is zero."""
        found = {i: right.get(i) for i in self.order}
        for k, i in enumerate(self.order):
            for j in self.order[k + 1 :]:
                found[j] = _less(found[j], self.entries.get((j, i)), found[i])
        for k, i in reversed(list(enumerate(self.order))):
            for j in self.order[k + 1 :]:
                found[i] = _less(found[i], self.entries.get((i, j)), found[j])
            own = found[i]
            found[i] = None if own is None else own * self.inverses[i]
        return found


def elimination_order(rows: tuple[int, ...], places: set[Place]) -> tuple[int, ...]:
    """The order that makes fewest new entries, row by row; of equal ones the last row first.

    The rows are also all columns, and the place of (i, j) counts as one of (j, i).
    """
    near = {i: {j for j in rows if j != i and ((i, j) in places or (j, i) in places)} for i in rows}
    left, order = set(rows), []

    def cost(i: int) -> tuple[int, int, int]:
        around = near[i] & left
        new = sum(a < b and b not in near[a] for a in around for b in around)
        return new, len(around), -i

    while left:
        i = min(left, key=cost)
        left.remove(i)
        order.append(i)
        around = near[i] & left
        for a in around:
            near[a] |= around - {a}
    return tuple(order)


def factorise(matrix: SparseMatrix) -> SparseFactors:
    """Factors of a matrix whose diagonal has all its entries.

    Not finite where a pivot is zero, which there is no other one in place of.
    """
    rows = tuple(sorted({i for i, _ in matrix}))
    order = elimination_order(rows, set(matrix))
    entries, inverses = dict(matrix), {}
    for k, i in enumerate(order):
        inverses[i] = 1.0 / entries.pop((i, i))
        for a in order[k + 1 :]:
            if (a, i) not in entries:
                continue
            head = entries[a, i] = entries[a, i] * inverses[i]
            for b in order[k + 1 :]:
                left = _less(entries.get((a, b)), head, entries.get((i, b)))
                if left is not None:
                    entries[a, b] = left
    return SparseFactors(entries, inverses, order)


def product(matrix: SparseMatrix, right: Mapping[int, Entry]) -> dict[int, Entry]:
    """A matrix times a vector, each by row; None for what is zero."""
    found: dict[int, Entry] = {}
    for (i, j), entry in matrix.items():
        found[i] = plus(found.get(i), times(entry, right.get(j)))
    return found


def _less(value: Entry, factor: Entry, other: Entry) -> Entry:
    """value − factor · other."""
    if factor is None or other is None:
        return value
    return -(factor * other) if value is None else value - factor * other

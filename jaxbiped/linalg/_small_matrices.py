"""Small dense matrices: unrolled elimination, and LAPACK's calls under `vmap` one after the other.

To be inverted or factorised, a matrix is a list of rows of scalars, in which None stands for an
entry that is zero whatever the state. Scalars may carry any batch shape, so that under `vmap` every
operation runs over the whole batch; batched LAPACK calls on tiny matrices are many times slower.
The inverse, and not factors: XLA repeats operations in each of their consumers, and with a
substitution, each of whose unknowns needs those before, `simulate` took 4.1 s to compile instead of
2.6. Batched calls of LAPACK on CPUs share XLA's thread pool, too, and wait in it for each other:
two at once on two cores wait for ever (seen with jaxlib 0.10.1).
"""

from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
from jax.custom_batching import sequential_vmap

from jaxbiped._types import Scalar
from jaxbiped.linalg._sparse_lu import Entry

Matrix: TypeAlias = list[list[Entry]]


def inverse(matrix: Matrix) -> list[list[Scalar]]:
    """The inverse of a square matrix, by Gauss and Jordan with partial pivoting.

    A singular one gives entries that are not finite.
    """
    size = len(matrix)
    known = [entry for row in matrix for entry in row if entry is not None]
    zero = jnp.zeros_like(sum(known[1:], known[0]))
    units = [[zero + 1.0 if j == i else zero for j in range(size)] for i in range(size)]
    # A row begins with the entries that are not eliminated yet.
    rows = [
        jnp.stack([zero if e is None else e + zero for e in row] + unit, axis=-1)
        for row, unit in zip(matrix, units, strict=True)
    ]
    for k in range(size):
        _largest_first(rows, k)
        heads = [row[..., :1] for row in rows]
        rows = [row[..., 1:] for row in rows]
        rows[k] = rows[k] / heads[k]
        for i in range(size):
            if i != k:
                rows[i] = rows[i] - heads[i] * rows[k]
    return [[row[..., j] for j in range(size)] for row in rows]


def solution(matrix: Scalar, right: Scalar) -> Scalar:
    """The solution of a square system (n, n), with right side (n,), by Gauss with pivoting.

    By operations on whole arrays, which NumPy runs in about the time of single rows.
    """
    rows, upper = jnp.concatenate([matrix, right[:, None]], axis=1), []
    for _ in range(len(rows)):
        place = jnp.argmax(jnp.abs(rows[:, 0]))
        moved = (jnp.arange(1, len(rows)) == place)[:, None]
        pivot, others = rows[place], jnp.where(moved, rows[0], rows[1:])
        upper.append(pivot[1:] / pivot[0])
        rows = others[:, 1:] - others[:, :1] * upper[-1]
    found = upper[-1]
    for row in upper[-2::-1]:
        found = jnp.concatenate([row[-1:] - row[:-1] @ found, found])
    return found


class PivotedFactors(NamedTuple):
    """L and U of a square matrix with the exchanges of its rows.

    Attributes:
        exchanged: for each column, whether the row at its place was exchanged with each one below.
        heads: how much of a pivot's row was taken from each one below.
        pivots: the pivots; `upper` what is right of each in its row, over the pivot.
    """

    exchanged: list[list[Scalar]]
    heads: list[list[Scalar]]
    pivots: list[Scalar]
    upper: list[Scalar]

    def solve(self, right: Scalar) -> Scalar:
        """What the matrix's inverse takes to a vector (n,)."""
        left = list(right)
        for k, pivot in enumerate(self.pivots):
            for i, larger in enumerate(self.exchanged[k], k + 1):
                below = left[i]
                left[i] = jnp.where(larger, left[k], below)
                left[k] = jnp.where(larger, below, left[k])
            left[k] = left[k] / pivot
            for i, head in enumerate(self.heads[k], k + 1):
                left[i] = left[i] - head * left[k]
        found: list[Scalar] = []
        for row, value in zip(reversed(self.upper), reversed(left), strict=True):
            found.append(value - row @ jnp.stack(found[::-1]) if found else value)
        return jnp.stack(found[::-1])


def pivoted(matrix: Scalar) -> PivotedFactors:
    """The factors of a matrix (n, n), by Gauss with partial pivoting."""
    rows, found = list(matrix), PivotedFactors([], [], [], [])
    for k in range(len(rows)):
        found.exchanged.append([larger[0] for larger in _largest_first(rows, k)])
        found.pivots.append(rows[k][0])
        found.upper.append(rows[k][1:] / rows[k][0])
        found.heads.append([row[0] for row in rows[k + 1 :]])
        rows[k + 1 :] = [row[1:] - row[0] * found.upper[k] for row in rows[k + 1 :]]
    return found


class BlockFactors(NamedTuple):
    """L and U of a matrix of square blocks, n rows in all. Only those of a block change places.

    For a method's stages, whose blocks on the diagonal are those of implicit steps, which have
    inverses.

    Attributes:
        lower: of each row of blocks, those of L left of its diagonal, which is one.
        upper: those of U right of its diagonal.
        inverses: of U's diagonal.
    """

    lower: list[list[Scalar]]
    upper: list[list[Scalar]]
    inverses: list[Scalar]

    def solve(self, right: Scalar) -> Scalar:
        """What the matrix takes to a vector (n,)."""
        found: list[Scalar] = []
        for row, part in zip(self.lower, self._parts(right), strict=True):
            found.append(_delete_row_and_column(part, row, found))
        behind: list[Scalar] = []
        for part in reversed(found):
            k = len(found) - 1 - len(behind)
            behind.insert(0, self.inverses[k] @ _delete_row_and_column(part, self.upper[k], behind))
        return jnp.concatenate(behind)

    def solve_transposed(self, right: Scalar) -> Scalar:
        """What its transpose takes to a vector (n,)."""
        found: list[Scalar] = []
        for k, part in enumerate(self._parts(right)):
            column = [row[k - 1 - i].T for i, row in enumerate(self.upper[:k])]
            found.append(self.inverses[k].T @ _delete_row_and_column(part, column, found))
        behind: list[Scalar] = []
        for part in reversed(found):
            k = len(found) - 1 - len(behind)
            column = [row[k].T for row in self.lower[k + 1 :]]
            behind.insert(0, _delete_row_and_column(part, column, behind))
        return jnp.concatenate(behind)

    def _parts(self, right: Scalar) -> list[Scalar]:
        return jnp.split(right, len(self.inverses))


def factorise(columns: Scalar) -> BlockFactors:
    """The factors of a matrix of m × m square blocks, by its columns (n, m, m, n).

    Column a of the block in row i and column l of blocks is `columns[a, i, l]`. They are worked on
    side by side: by lanes in vectors.
    """
    found = BlockFactors([[] for _ in range(columns.shape[1])], [], [])
    while columns.shape[1]:
        found.upper.append(list(jnp.moveaxis(columns[:, 0, 1:], 0, -1)))
        inverse, heads, columns = _eliminate_first(columns)
        found.inverses.append(inverse)
        for row, head in zip(found.lower[len(found.inverses) :], heads, strict=True):
            row.append(head)
    return found


def _eliminate_first(columns: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """The inverse of the first block, those of L below it, and columns of what is then left."""
    factors, below = pivoted(columns[:, 0, 0].T), jnp.moveaxis(columns[:, 1:, 0], 0, -1)

    def inverted(unit: Scalar) -> tuple[Scalar, Scalar]:
        own = factors.solve(unit)
        return own, below @ own

    found = jax.lax.map(inverted, jnp.eye(len(columns)))
    inverse, heads = (jnp.moveaxis(each, 0, -1) for each in found)

    def left(column: Scalar) -> Scalar:
        return column[1:, 1:] - jnp.einsum("iab,lb->ila", heads, column[0, 1:])

    return inverse, heads, jax.lax.map(left, columns)


def _delete_row_and_column(part: Scalar, blocks: list[Scalar], known: list[Scalar]) -> Scalar:
    """What is left of a right side when known unknowns are taken out."""
    for block, each in zip(blocks, known, strict=True):
        part = part - block @ each
    return part


def _largest_first(rows: list[Scalar], k: int) -> list[Scalar]:
    """Brings the row with the largest first entry to place `k`, of those from there on.

    Whether each row behind it was exchanged, one after the other.
    """
    exchanged = []
    for i in range(k + 1, len(rows)):
        larger = jnp.abs(rows[i][..., :1]) > jnp.abs(rows[k][..., :1])
        above, below = rows[k], rows[i]
        rows[k] = jnp.where(larger, below, above)
        rows[i] = jnp.where(larger, above, below)
        exchanged.append(larger)
    return exchanged


class SymmetricFactors(NamedTuple):
    """L D Lᵀ of a symmetric positive matrix.

    Attributes:
        lower: rows of L, the unit diagonal left out.
        inverse: the inverses of the entries of D.
    """

    lower: list[list[Scalar]]
    inverse: list[Scalar]

    def solve(self, right: list[Scalar]) -> list[Scalar]:
        """The solution of the system with this right side."""
        lower, forward = self.lower, list[Scalar]()
        for i, value in enumerate(right):
            known = [lower[i][k] * forward[k] for k in range(i)]
            forward.append(value - _total(known, value))
        found = [value * over for value, over in zip(forward, self.inverse, strict=True)]
        for i in reversed(range(len(found))):
            known = [lower[k][i] * found[k] for k in range(i + 1, len(found))]
            found[i] = found[i] - _total(known, found[i])
        return found


def symmetric_factors(matrix: list[list[Scalar]], least: float | None = None) -> SymmetricFactors:
    """Factors of a symmetric positive matrix; not finite, or huge, where it is singular.

    Only the lower half of its rows is read. The solution is zero in a row whose pivot is at most
    the share `least` of its own entry.
    """
    lower, diagonal, inverse = list[list[Scalar]](), list[Scalar](), list[Scalar]()
    for i, row in enumerate(matrix):
        scaled: list[Scalar] = []
        for j in range(i):
            known = [scaled[k] * diagonal[k] * lower[j][k] for k in range(j)]
            scaled.append((row[j] - _total(known, row[j])) * inverse[j])
        known = [scaled[k] * scaled[k] * diagonal[k] for k in range(i)]
        pivot = row[i] - _total(known, row[i])
        diagonal.append(pivot)
        if least is not None:
            pivot = jnp.where(pivot > least * row[i], pivot, jnp.inf)
        inverse.append(1.0 / pivot)
        lower.append(scaled)
    return SymmetricFactors(lower, inverse)


def _total(terms: list[Scalar], like: Scalar) -> Scalar:
    return sum(terms[1:], terms[0]) if terms else jnp.zeros_like(like)


@sequential_vmap
def solve(matrix: Scalar, right: Scalar) -> Scalar:
    """The solution of a square system (n, n), right side (n,) or (n, k)."""
    return jnp.linalg.solve(matrix, right)


@sequential_vmap
def eigenpairs(matrix: Scalar) -> tuple[Scalar, Scalar]:
    """Eigenvalues (n,) and right eigenvectors, its columns."""
    values, vectors = jax.lax.linalg.eig(matrix, compute_left_eigenvectors=False)
    return values, vectors


class Eigensystem(NamedTuple):
    """Eigenvalues (n,), right eigenvectors (columns) and left ones (rows), wᵀ v = 1 in pairs.

    A left one is infinite or huge where its eigenvalue has fewer eigenvectors than it has places.
    """

    values: Scalar
    right: Scalar
    left: Scalar


@sequential_vmap
def eigensystem(matrix: Scalar) -> Eigensystem:
    """Eigenvalues with eigenvectors of both sides.

    Each pair is found by itself: the inverse of all right vectors would carry the parallel ones of
    a multiple eigenvalue (the zeros of a section and of a push) into the rows of all others.
    """
    values, left, right = jax.lax.linalg.eig(matrix)
    left = jnp.conj(left)
    return Eigensystem(values, right, (left / jnp.sum(left * right, axis=0)).T)


@sequential_vmap
def singular_pairs(matrix: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Left vectors (columns), singular values and right vectors (rows) of (n, k), n at least k."""
    left, values, right = jnp.linalg.svd(matrix, full_matrices=False)
    return left, values, right

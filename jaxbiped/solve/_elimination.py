"""Small linear systems, solved by elimination unrolled over scalars.

A matrix is a list of rows of scalars, in which None stands for an entry that is zero whatever the
state: what a scene does not couple is not computed. Scalars may carry any batch shape, so that
under `vmap` every operation runs over the whole batch; batched LAPACK calls on tiny matrices are
many times slower.
"""

from typing import TypeAlias

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._types import Scalar

Entry: TypeAlias = Scalar | None
Matrix: TypeAlias = list[list[Entry]]


class _Swap(eqx.Module):
    row: int = eqx.field(static=True)
    other: int = eqx.field(static=True)
    happens: Scalar | None
    """A boolean, or None where the swap is certain."""


class _Subtract(eqx.Module):
    row: int = eqx.field(static=True)
    source: int = eqx.field(static=True)
    factor: Scalar


class Factors(eqx.Module):
    """An LU factorisation with partial pivoting.

    Attributes:
        steps: row operations that reduce the matrix, in order.
        upper: the upper triangle that is left.
        pivots: inverses of its diagonal.
    """

    steps: list[_Swap | _Subtract]
    upper: Matrix
    pivots: list[Scalar]


def factorise(matrix: Matrix) -> Factors:
    """Factorises a square matrix. A singular one gives entries that are not finite."""
    rows = [list(row) for row in matrix]
    size = len(rows)
    steps: list[_Swap | _Subtract] = []
    pivots: list[Scalar] = []
    for k in range(size):
        _bring_largest_up(rows, k, steps)
        pivot = rows[k][k]
        if pivot is None:
            raise ValueError(f"The matrix is singular whatever its entries: column {k} is empty.")
        inverse = 1.0 / pivot
        pivots.append(inverse)
        for i in range(k + 1, size):
            entry = rows[i][k]
            if entry is None:
                continue
            factor = entry * inverse
            steps.append(_Subtract(i, k, factor))
            for j in range(k + 1, size):
                rows[i][j] = _minus(rows[i][j], factor, rows[k][j])
    return Factors(steps, rows, pivots)


def solve(factors: Factors, right: list[Scalar]) -> list[Scalar]:
    """Solution of the factorised system for one right-hand side."""
    x = list(right)
    for step in factors.steps:
        if isinstance(step, _Subtract):
            x[step.row] = x[step.row] - step.factor * x[step.source]
        else:
            x[step.row], x[step.other] = _swapped(step.happens, x[step.row], x[step.other])
    for k in reversed(range(len(x))):
        total = x[k]
        for j in range(k + 1, len(x)):
            entry = factors.upper[k][j]
            if entry is not None:
                total = total - entry * x[j]
        x[k] = total * factors.pivots[k]
    return x


def _bring_largest_up(rows: Matrix, k: int, steps: list[_Swap | _Subtract]) -> None:
    for i in range(k + 1, len(rows)):
        candidate, current = rows[i][k], rows[k][k]
        if candidate is None:
            continue
        happens = None if current is None else jnp.abs(candidate) > jnp.abs(current)
        steps.append(_Swap(k, i, happens))
        for j in range(k, len(rows)):
            rows[k][j], rows[i][j] = _swapped_entries(happens, rows[k][j], rows[i][j])


def _swapped(happens: Scalar | None, a: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
    if happens is None:
        return b, a
    return jnp.where(happens, b, a), jnp.where(happens, a, b)


def _swapped_entries(happens: Scalar | None, a: Entry, b: Entry) -> tuple[Entry, Entry]:
    if happens is None:
        return b, a
    if a is None and b is None:
        return None, None
    return _swapped(happens, _or_zero(a, b), _or_zero(b, a))


def _or_zero(entry: Entry, other: Entry) -> Scalar:
    """The entry; where it is a structural zero, a zero shaped as the other one, which is none."""
    if entry is not None:
        return entry
    assert other is not None
    return jnp.zeros_like(other)


def _minus(entry: Entry, factor: Scalar, subtrahend: Entry) -> Entry:
    if subtrahend is None:
        return entry
    product = factor * subtrahend
    return -product if entry is None else entry - product

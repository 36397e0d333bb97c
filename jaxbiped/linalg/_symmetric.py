"""Small symmetric positive systems, solved by elimination unrolled over scalars.

A matrix is a list of rows of scalars, of any common batch shape; only its lower half is read.
"""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar


class Factors(NamedTuple):
    """L D Lᵀ of a symmetric positive matrix.

    Attributes:
        lower: rows of L, the unit diagonal left out.
        inverse: the inverses of the entries of D.
    """

    lower: list[list[Scalar]]
    inverse: list[Scalar]


def factorise(matrix: list[list[Scalar]]) -> Factors:
    """Factors of a symmetric positive matrix; not finite, or huge, where it is singular."""
    lower: list[list[Scalar]] = []
    diagonal: list[Scalar] = []
    inverse: list[Scalar] = []
    for i, row in enumerate(matrix):
        scaled: list[Scalar] = []
        for j in range(i):
            known = [scaled[k] * diagonal[k] * lower[j][k] for k in range(j)]
            scaled.append((row[j] - _total(known, row[j])) * inverse[j])
        known = [scaled[k] * scaled[k] * diagonal[k] for k in range(i)]
        diagonal.append(row[i] - _total(known, row[i]))
        inverse.append(1.0 / diagonal[i])
        lower.append(scaled)
    return Factors(lower, inverse)


def solve(factors: Factors, right: list[Scalar]) -> list[Scalar]:
    """The solution of the system with this right side."""
    lower, inverse = factors
    size = len(right)
    forward: list[Scalar] = []
    for i in range(size):
        known = [lower[i][k] * forward[k] for k in range(i)]
        forward.append(right[i] - _total(known, right[i]))
    found = [value * over for value, over in zip(forward, inverse, strict=True)]
    for i in reversed(range(size)):
        known = [lower[k][i] * found[k] for k in range(i + 1, size)]
        found[i] = found[i] - _total(known, found[i])
    return found


def _total(terms: list[Scalar], like: Scalar) -> Scalar:
    return sum(terms[1:], terms[0]) if terms else jnp.zeros_like(like)

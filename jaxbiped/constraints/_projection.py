"""Taking coordinates and rates back to the constraints."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax

from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_method import (
    AbstractProjectingMethod,
    Row,
    gram,
    inverse_masses,
    moved_by,
)
from jaxbiped.constraints._linkage import Linkage
from jaxbiped.constraints._linkage_constraints import along, constraints_of, masses_of
from jaxbiped.linalg._symmetric import factorised, solved

_ITERATIONS = 12
"""Of the search for the nearest consistent state: a tenth of a metre is taken off to rounding."""


def stepped_back(
    linkage: Linkage,
    method: AbstractProjectingMethod,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
) -> tuple[list[Scalar], list[Scalar]]:
    """Coordinates and rates corrected as a method does after each step.

    Plain arithmetic, a fixed number of times: derivatives pass through as exactly as values.
    """
    masses, q, v = masses_of(linkage), list(q), list(v)
    for _ in range(method.iterations):
        at = constraints_of(linkage, q, v)
        q = _moved(q, method.step_back(masses, at.rows, at.violation))
    at = constraints_of(linkage, q, v)
    return q, _moved(v, method.step_back(masses, at.rows, at.rate))


@eqx.filter_jit
def nearest(
    linkage: Linkage, q: Sequence[Scalar], v: Sequence[Scalar]
) -> tuple[list[Scalar], list[Scalar]]:
    """The consistent coordinates and rates nearest in the mass metric.

    min Δqᵀ M Δq with Φ(q + Δq) = 0: each iteration solves it with the constraints linearised where
    the last one ended, so that what it converges to is nearest to the start and not only near.
    """
    weights, origin = inverse_masses(masses_of(linkage)), list(q)

    def least(rows: list[Row], residual: list[Scalar]) -> Row:
        # Shifted by nearly nothing, so that constraints that say the same twice share.
        matrix = gram(rows, weights)
        shift = 1e-14 * sum((matrix[i][i] for i in range(1, len(matrix))), matrix[0][0])
        return moved_by(rows, weights, solved(factorised(gram(rows, weights, shift)), residual))

    def nearer(_: Any, q: list[Scalar]) -> list[Scalar]:
        at = constraints_of(linkage, q, v)
        gone = [a - b for a, b in zip(q, origin, strict=True)]
        left = [off - along(row, gone) for off, row in zip(at.violation, at.rows, strict=True)]
        return _moved(origin, least(at.rows, left))

    if not linkage.joints:
        return origin, list(v)
    found = jax.lax.fori_loop(0, _ITERATIONS, nearer, origin)
    at = constraints_of(linkage, found, v)
    return found, _moved(v, least(at.rows, at.rate))


def _moved(values: Sequence[Scalar], moves: Row) -> list[Scalar]:
    return [value + moves[i] if i in moves else value for i, value in enumerate(values)]

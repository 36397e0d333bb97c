"""Projection onto the constraints of a linkage, and whether these are independent."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import kept_alone
from jaxbiped.constraints._constraint_method import (
    AbstractConstraintMethod,
    AbstractProjectingMethod,
    Row,
    applied_impulse,
    gram,
    inverse_masses,
)
from jaxbiped.constraints._linkage import Linkage, constraints_of, masses_of, row_times
from jaxbiped.linalg._elimination import symmetric_factors

_LEAST = 1e-10
"""Smallest eigenvalue of J M⁻¹ Jᵀ, in units of the largest, of constraints that are independent."""


def check_independent(
    linkage: Linkage, method: AbstractConstraintMethod, q: Sequence[Scalar]
) -> None:
    """Refuses constraints that say the same twice, where the method cannot bear it.

    Raises:
        ArgumentError: for a method that needs independent constraints. What is being traced, or
            a batch, is not looked at.
    """
    lower = _gram_of(linkage, list(q)) if method.needs_independent else []
    if not lower:
        return
    entries = [entry for row in lower for entry in row]
    if any(isinstance(entry, jax.core.Tracer) or jnp.ndim(entry) for entry in entries):
        return
    matrix = np.zeros((len(lower), len(lower)))
    for i, row in enumerate(lower):
        matrix[i, : i + 1] = matrix[: i + 1, i] = [float(entry) for entry in row]
    values = np.linalg.eigvalsh(matrix)
    excess = int(np.sum(values < _LEAST * values[-1]))
    if excess:
        raise ArgumentError(
            f"method = {type(method).__name__} is not allowed here: {excess} of {len(lower)} "
            "constraints are redundant, because they follow from the others (such as a joint that "
            "is given twice); remove them, or use Penalty, Augmented or Index1Augmented."
        )


@kept_alone
def _gram_of(linkage: Linkage, q: list[Scalar]) -> list[list[Scalar]]:
    """J M⁻¹ Jᵀ of its constraints at rest: the entries of the lower triangle."""
    at = constraints_of(linkage, q, [jnp.zeros_like(value) for value in q])
    return gram(at.rows, inverse_masses(masses_of(linkage)))


_ITERATIONS = 12
"""Of the search for the nearest consistent state: a tenth of a metre is taken off to rounding."""


def correct_step(
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
        q = _add(q, method.step_back(masses, at.rows, at.violation))
    at = constraints_of(linkage, q, v)
    return q, _add(v, method.step_back(masses, at.rows, at.rate))


@cached_jit
def nearest_consistent(
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
        return applied_impulse(
            rows, weights, symmetric_factors(gram(rows, weights, shift)).solve(residual)
        )

    def nearer(_: Scalar, q: list[Scalar]) -> list[Scalar]:
        at = constraints_of(linkage, q, v)
        gone = [a - b for a, b in zip(q, origin, strict=True)]
        left = [off - row_times(row, gone) for off, row in zip(at.violation, at.rows, strict=True)]
        return _add(origin, least(at.rows, left))

    if not constraints_of(linkage, q, v).rows:
        return origin, list(v)
    found = jax.lax.fori_loop(0, _ITERATIONS, nearer, origin)
    at = constraints_of(linkage, found, v)
    return found, _add(v, least(at.rows, at.rate))


def _add(values: Sequence[Scalar], moves: Row) -> list[Scalar]:
    return [value + moves[i] if i in moves else value for i, value in enumerate(values)]

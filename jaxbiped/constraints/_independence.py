"""Independence of a linkage's constraints."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._cached_jit import kept_alone
from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod, gram, inverse_masses
from jaxbiped.constraints._linkage import Linkage
from jaxbiped.constraints._linkage_constraints import constraints_of, masses_of

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
    if not method.needs_independent or not linkage.joints:
        return
    lower = _gram_of(linkage, list(q))
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
            "constraints say what others say already, which makes it singular; use Penalty, "
            "Augmented or Index1Augmented."
        )


@kept_alone
def _gram_of(linkage: Linkage, q: list[Scalar]) -> list[list[Scalar]]:
    """J M⁻¹ Jᵀ of its constraints at rest: the entries of the lower triangle."""
    at = constraints_of(linkage, q, [jnp.zeros_like(value) for value in q])
    return gram(at.rows, inverse_masses(masses_of(linkage)))

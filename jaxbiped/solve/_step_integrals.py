"""Integrals along a solve: the sums of rates over its steps, by Gauss's rule on their courses."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.solve._steps import Step

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
"""Of a step: as exact as the course within it."""


@dataclasses.dataclass(frozen=True)
class StepIntegrals:
    """What is summed along a solve. Hashable.

    Attributes:
        rates: a function of (scene, state) with the rates.
        at_strike: a function of (scene, state just before a strike) with what is added there, of
            the same shape.
        at_reset: a function of (scene, state before a reset, state behind it) likewise.
    """

    rates: Callable[[Any, PyTree], PyTree]
    at_strike: Callable[[Any, PyTree], PyTree]
    at_reset: Callable[[Any, PyTree, PyTree], PyTree]

    def at_end(self, scene: Any, step: Step) -> PyTree:
        """What a step's end adds by a strike, or by another reset of the state."""
        assert step.end is not None
        assert step.strikes is not None
        struck, before = step.strikes, step.end()
        reset = struck if step.changes is None else struck | step.changes
        terms = self.at_strike(scene, before), self.at_reset(scene, before, step.y1)
        return jtu.tree_map(
            lambda a, b: jnp.where(struck, a, 0.0) + jnp.where(reset, b, 0.0), *terms
        )

    def over(
        self, scene: Any, course: Callable[[Any], PyTree], t0: Scalar, t1: Scalar, nothing: PyTree
    ) -> PyTree:
        """The integrals between two times [s] of the states that a course has.

        `nothing` has the shape of the rates, and zeros.
        """
        half, middle = 0.5 * (t1 - t0), 0.5 * (t1 + t0)

        def add(total: PyTree, point: tuple[Scalar, Scalar]) -> tuple[PyTree, None]:
            node, weight = point
            rates = self.rates(scene, course(middle + half * node))
            return jtu.tree_map(lambda sum_, rate: sum_ + half * weight * rate, total, rates), None

        points = jnp.asarray(_NODES), jnp.asarray(_WEIGHTS)
        return jax.lax.scan(add, nothing, points)[0]


class Summed(NamedTuple):
    """What is carried of integrals from attempt to attempt.

    Attributes:
        last: the last step, a `LastStep`.
        totals: the integrals so far.
    """

    last: Any
    totals: PyTree

"""Explicit Runge–Kutta methods by which rigid walkers step: their tableaux, as diffrax has them."""

import dataclasses
from typing import Any, NamedTuple

import diffrax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.solve._solvers import SOLVERS

_INTERPOLATED = 2.0
"""Largest error of an interpolated opening or gap [rad] over a step of Dormand and Prince's method
whose own error is the tolerance, as measured, in units of rtol^¾."""


class Tableau(NamedTuple):
    """Weights of a method with s stages, the last of which lies at the end of the step.

    Attributes:
        stages: of the stages before in each but the first one, shape (s - 1, s).
        end: of the stages in the end, shape (s,).
        error: the same of its estimated error; zeros where there is no estimate.
        order: order of the error of a step's end, by which an error tells the length of steps.
    """

    stages: np.ndarray
    end: np.ndarray
    error: np.ndarray
    order: int


@dataclasses.dataclass(frozen=True)
class ExplicitMethod:
    """A method by name. Hashable.

    Attributes:
        name: one of `EXPLICIT_METHODS`.
        embedded: whether steps go on with the embedded solution, by which the error is estimated:
            another method, one order lower.
    """

    name: str = "dopri8"
    embedded: bool = False

    @property
    def tableau(self) -> Tableau:
        """Its weights."""
        tableau = _TABLEAUX[self.name]
        return tableau._replace(end=tableau.end - tableau.error) if self.embedded else tableau

    @property
    def estimates(self) -> bool:
        """Whether it estimates its error, which steps of no given size need."""
        return bool(np.any(self.tableau.error))

    def length(self, error: Scalar) -> Scalar:
        """Of a step in units of the one whose error is the tolerance, from its error in these."""
        error = jnp.maximum(error, 1e-10)
        if self.tableau.order == 8:
            return jnp.sqrt(jnp.sqrt(jnp.sqrt(error)))
        return jnp.exp(jnp.log(error) / self.tableau.order)

    def interpolation_error(self, rtol: Scalar, length: Scalar) -> Scalar:
        """Largest error of an opening or a gap by a quintic over a step of this length [rad].

        That of order six, where the step's error of the method's order is a tolerance.
        """
        if self.tableau.order == 8:
            root = jnp.sqrt(rtol)
            return _INTERPOLATED * root * jnp.sqrt(root) * length**6
        return _INTERPOLATED * jnp.exp(jnp.log(rtol) * (6.0 / self.tableau.order)) * length**6


_ORDERS = {"bosh3": 3, "tsit5": 5, "dopri5": 5, "dopri8": 8, "euler": 1, "runge2": 2}

EXPLICIT_METHODS: dict[str, Any] = {name: SOLVERS[name] for name in _ORDERS}
"""Those of `SOLVERS` that rigid walkers take, too."""


def _tableau(solver: Any, order: int) -> Tableau:
    if solver is diffrax.Euler:  # which has no tableau: its step, and a stage at the end
        return Tableau(np.array([[1.0, 0.0]]), np.array([1.0, 0.0]), np.zeros(2), order)
    given = solver.tableau
    end, error, rows = given.b_sol, given.b_error, given.a_lower
    if given.fsal and error[-1] == 0.0 and given.c[-2] == 1.0:
        # The stage before already lies at the end; this one would only be the next step's first.
        end, error, rows = end[:-1], error[:-1], rows[:-1]
    stages = np.zeros((len(rows), 1 + len(rows)))
    for row, weights in zip(stages, rows, strict=True):
        row[: len(weights)] = weights
    return Tableau(stages, end, error, order)


_TABLEAUX = {name: _tableau(solver, _ORDERS[name]) for name, solver in EXPLICIT_METHODS.items()}

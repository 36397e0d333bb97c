"""Linearisation of a vector field about a point, whatever form its Jacobian has."""

import abc
from collections.abc import Callable
from typing import TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.linalg._elimination import Entry
from jaxbiped.solve.rosenbrock._program_structure import Structure

Components: TypeAlias = list[Scalar]
"""A point of the state space: its scalars one by one, or one vector that holds them all."""


class AbstractLinearisation(eqx.Module):
    """A vector field about one point, its state split into components.

    Attributes:
        run: the field, of the time and the components.
        structure: of that program.
        t, y: the point.
    """

    run: Callable[..., Components]
    structure: Structure
    t: Scalar
    y: tuple[Scalar, ...]

    @abc.abstractmethod
    def jacobian(self) -> PyTree:
        """J = ∂f/∂y at the point of linearisation, in a form of its own."""

    @abc.abstractmethod
    def factorise(self, jacobian: PyTree, step: Scalar) -> PyTree:
        """What `solve_kept` needs of I − step J."""

    @abc.abstractmethod
    def solve_kept(
        self,
        factors: PyTree,
        jacobian: PyTree,
        step: Scalar,
        right: Components,
        direct_right: dict[int, Scalar],
    ) -> Components:
        """The kept components of (I − step J)⁻¹ r.

        `right` holds r of the kept components, `direct_right` of the direct ones.
        """

    @abc.abstractmethod
    def solution_matrices(
        self, factors: PyTree, jacobian: PyTree, step: Scalar
    ) -> tuple[Scalar, Scalar]:
        """What `solve_kept` takes r to, as matrices: of the kept components (k, k), and of the d
        direct ones (k, d)."""

    def evaluate(self, t: Scalar, y: Components) -> Components:
        """The vector field at any point."""
        return self.run(t, *y)

    def time_derivative(self) -> list[Entry]:
        """∂f/∂t at the point of linearisation; None for a component that has none."""
        return self._column(0)

    def direct(self) -> dict[int, int]:
        """Components whose rate *is* another, kept component, each with that one."""
        direct: dict[int, int] = {}
        for i, copied in enumerate(self.structure.copies):
            source = None if copied is None else copied - 1
            if source is None or source < 0 or source == i:
                continue
            if source not in direct and i not in direct.values():
                direct[i] = source
        return direct

    def kept(self) -> list[int]:
        """The other components, which remain when the direct ones are eliminated."""
        direct = self.direct()
        return [i for i in range(len(self.y)) if i not in direct]

    def _column(self, position: int) -> list[Entry]:
        """Derivatives of all rates with respect to one input (0: time, 1 on: components)."""
        inputs = [self.t, *self.y]
        if not any(position in used for used in self.structure.depends):
            return [None] * len(self.y)

        def along(value: Scalar) -> list[Scalar]:
            return self.run(*inputs[:position], value, *inputs[position + 1 :])

        _, tangents = jax.jvp(along, (inputs[position],), (jnp.ones_like(inputs[position]),))
        return [
            tangent if position in used else None
            for tangent, used in zip(tangents, self.structure.depends, strict=True)
        ]

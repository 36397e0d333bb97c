"""Vector fields with a linearly implicit form, in which implicit steps are cheaper.

Where M(y) ẏ = F(y) gives the rates, the Jacobian of M⁻¹ F is full. M and the derivatives of
F − M ẏ at fixed rates have zeros wherever two bodies do not act on each other, and with M⁻¹
multiplied away a step's linear system has these zeros, too.
"""

import abc
from typing import TypeAlias

import equinox as eqx
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.linalg._sparse_lu import SparseMatrix

Residual: TypeAlias = dict[int, Scalar]
"""F − M ẏ by the positions of leaves."""


class AbstractImplicitField(eqx.Module):
    """An autonomous vector field, of states that are pytrees of scalars, with its implicit form.

    Leaves are meant by their positions in the state. The form holds for all of them but those whose
    rate is a copy of another leaf, as a place's rate is a velocity.
    """

    @abc.abstractmethod
    def __call__(self, t: Time, y: PyTree, args: PyTree) -> PyTree:
        """Time derivative of the state, in the form that `diffrax.ODETerm` takes."""

    @abc.abstractmethod
    def mass_matrix(self, y: PyTree, args: PyTree) -> SparseMatrix:
        """M(y), symmetric; a leaf that is left out stands alone, with a one on the diagonal."""

    @abc.abstractmethod
    def residual(self, y: PyTree, rates: PyTree, args: PyTree) -> Residual:
        """F(y) − M(y) ẏ for rates that are given, shaped as the state."""

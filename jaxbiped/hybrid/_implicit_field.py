"""Vector fields with a linearly implicit form, in which implicit steps are cheaper.

Where M(y) ẏ = F(y) gives the rates, the Jacobian of M⁻¹ F is full. M and the derivatives of
F − M ẏ at fixed rates have zeros wherever two bodies do not act on each other, and with M⁻¹
multiplied away a step's linear system has these zeros, too.
"""

from collections.abc import Callable
from typing import TypeAlias

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, VectorField
from jaxbiped.linalg._sparse_lu import SparseMatrix

Residual: TypeAlias = dict[int, Scalar]
"""F − M ẏ by the positions of leaves."""


class ImplicitField(eqx.Module):
    """An autonomous vector field, of states that are pytrees of scalars, with its implicit form.

    Leaves are meant by their positions in the state. The form holds for all of them but those whose
    rate is a copy of another leaf, as a place's rate is a velocity.

    Attributes:
        field: time derivative of the state, in the form that `diffrax.ODETerm` takes.
        mass_matrix: M(y) from (args, y), symmetric; a leaf that is left out stands alone, with a
            one on the diagonal.
        residual: F(y) − M(y) ẏ from (args, y, rates) for rates that are given, shaped as the state.
    """

    field: VectorField = eqx.field(static=True)
    mass_matrix: Callable[[PyTree, PyTree], SparseMatrix] = eqx.field(static=True)
    residual: Callable[[PyTree, PyTree, PyTree], Residual] = eqx.field(static=True)

    def __call__(self, t: Time, y: PyTree, args: PyTree) -> PyTree:
        return self.field(t, y, args)


def with_unit_mass(field: VectorField) -> ImplicitField:
    """A field whose implicit form is its own, M = 1: forces of constraints reach every body."""

    def residual(args: PyTree, y: PyTree, rates: PyTree) -> Residual:
        here = jtu.tree_leaves(field(jnp.zeros(()), y, args))
        pairs = zip(here, jtu.tree_leaves(rates), strict=True)
        return {i: a - b for i, (a, b) in enumerate(pairs)}

    return ImplicitField(field, lambda args, y: {}, residual)

"""Linearisation of a vector field: value, exact Jacobian, and (I − g J)⁻¹ on vectors.

Entries that are zero by structure, read off the field's own program, are left out.
"""

import math
from collections.abc import Callable

import jax
import jax.extend
import jax.flatten_util
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.dynamics._implicit_field import AbstractImplicitField
from jaxbiped.linalg._small_matrices import Matrix, inverse
from jaxbiped.linalg._sparse_lu import Entry
from jaxbiped.solve.rosenbrock._abstract_linearisation import (
    AbstractLinearisation,
    Components,
    StepMatrix,
    structure_of,
)
from jaxbiped.solve.rosenbrock._implicit_linearisation import ImplicitForm, ImplicitLinearisation

_MOST_SCALARS = 24
"""Up to this size a Jacobian is eliminated scalar by scalar; beyond, as one dense matrix."""


def split(y: PyTree, field: object = None) -> tuple[Components, Callable[[Components], PyTree]]:
    """The components of `y` and the map back; scalars if `field` has an implicit form."""
    leaves, structure = jtu.tree_flatten(y)
    few = sum(jnp.size(leaf) for leaf in leaves) <= _MOST_SCALARS
    if not few and not isinstance(field, AbstractImplicitField):
        vector, unravel = jax.flatten_util.ravel_pytree(y)
        return [vector], lambda components: unravel(components[0])
    shapes = [jnp.shape(leaf) for leaf in leaves]
    scalars: Components = []
    for leaf in leaves:
        scalars.extend([leaf] if jnp.ndim(leaf) == 0 else list(jnp.ravel(leaf)))

    def join(components: Components) -> PyTree:
        rest = iter(components)
        joined = []
        for shape in shapes:
            if shape == ():
                joined.append(next(rest))
            else:
                parts = [next(rest) for _ in range(math.prod(shape))]
                joined.append(jnp.stack(parts).reshape(shape))
        return jtu.tree_unflatten(structure, joined)

    return scalars, join


def linearise(
    field: Callable[[Scalar, Components], Components],
    t: Scalar,
    y: Components,
    form: ImplicitForm | None = None,
) -> AbstractLinearisation:
    """Linearises a vector field of components (as `split` makes them) about (t, y)."""
    program = jax.make_jaxpr(lambda t, *y: field(t, list(y)))(t, *y)
    run = jax.extend.core.jaxpr_as_fun(program)
    if form is not None and form.exists:
        return ImplicitLinearisation(run, structure_of(program), t, tuple(y), form)
    dense = len(y) == 1 and jnp.ndim(y[0]) == 1
    kind = _DenseLinearisation if dense else _ScalarLinearisation
    return kind(run, structure_of(program), t, tuple(y))


class _DenseLinearisation(AbstractLinearisation):
    """One vector, one dense matrix."""

    def jacobian(self) -> PyTree:
        return jax.jacfwd(lambda y: self.run(self.t, y)[0])(self.y[0])

    def factorise(self, jacobian: PyTree, step: Scalar) -> PyTree:
        identity = jnp.eye(self.y[0].size, dtype=self.y[0].dtype)
        return jax.scipy.linalg.lu_factor(identity - step * jacobian)

    def solve_kept(
        self, matrix: StepMatrix, right: Components, direct_right: dict[int, Scalar]
    ) -> Components:
        return [jax.scipy.linalg.lu_solve(matrix.factors, right[0])]

    def solution_matrices(self, matrix: StepMatrix) -> tuple[Scalar, Scalar]:
        size = self.y[0].size
        return jax.scipy.linalg.lu_solve(matrix.factors, jnp.eye(size)), jnp.zeros((size, 0))


class _ScalarLinearisation(AbstractLinearisation):
    """Scalars one by one, with what is zero by structure left out.

    A component whose rate *is* another component, as a position's rate is a velocity, is
    eliminated by hand: its row of (I − g J) u = r reads u_i = r_i + g u_j. A second-order system
    of n coordinates so costs an n × n elimination, not 2n × 2n.
    """

    def jacobian(self) -> Matrix:
        columns = [self._column(1 + j) for j in range(len(self.y))]
        return [list(row) for row in zip(*columns, strict=True)]

    def factorise(self, jacobian: Matrix, step: Scalar) -> list[list[Scalar]]:
        return inverse(_reduced_matrix(jacobian, self.direct(), self.kept(), step))

    def solve_kept(
        self, matrix: StepMatrix, right: Components, direct_right: dict[int, Scalar]
    ) -> Components:
        reduced = []
        for i, own in zip(self.kept(), right, strict=True):
            entries = [(matrix.jacobian[i][p], value) for p, value in direct_right.items()]
            terms = [entry * value for entry, value in entries if entry is not None]
            reduced.append(own + matrix.step * sum(terms[1:], terms[0]) if terms else own)
        products = [[a * b for a, b in zip(row, reduced, strict=True)] for row in matrix.factors]
        return [sum(row[1:], row[0]) for row in products]

    def solution_matrices(self, matrix: StepMatrix) -> tuple[Scalar, Scalar]:
        jacobian, step, factors = matrix
        inverse = jnp.stack([jnp.stack(row) for row in factors])
        kept, direct = self.kept(), self.direct()
        if not direct:
            return inverse, jnp.zeros((len(kept), 0))
        zero = jnp.zeros_like(step)
        rows = [[zero if (own := jacobian[i][p]) is None else own for p in direct] for i in kept]
        return inverse, step * (inverse @ jnp.stack([jnp.stack(row) for row in rows]))


def _reduced_matrix(
    jacobian: Matrix, direct: dict[int, int], kept: list[int], step: Scalar
) -> Matrix:
    """I − g J with the direct components eliminated."""
    matrix: Matrix = []
    for i in kept:
        row: list[Entry] = []
        for j in kept:
            entry = jacobian[i][j]
            for position, source in direct.items():
                indirect = jacobian[i][position]
                if source == j and indirect is not None:
                    entry = step * indirect if entry is None else entry + step * indirect
            scaled = None if entry is None else step * entry
            if i == j:
                row.append(jnp.ones_like(step) if scaled is None else 1.0 - scaled)
            else:
                row.append(None if scaled is None else -scaled)
        matrix.append(row)
    return matrix

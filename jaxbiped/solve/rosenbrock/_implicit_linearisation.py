"""Linearisation of a vector field by its implicit form, whose matrices have the zeros of a tree.

Where a field has none, by its program.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.extend
import jax.flatten_util
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.compiler import partial_derivatives
from jaxbiped.dynamics._implicit_field import AbstractImplicitField, Residual
from jaxbiped.linalg._sparse_lu import (
    Entry,
    SparseFactors,
    SparseMatrix,
    factorise,
    plus,
    product,
    times,
)
from jaxbiped.solve.rosenbrock._linearisation import (
    AbstractLinearisation,
    Components,
    DenseLinearisation,
    ScalarLinearisation,
    StepMatrix,
    structure_of,
)

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


class ImplicitForm(NamedTuple):
    """The implicit form of a field (t, y, args), if it has one, in components.

    `join` makes states of them.
    """

    field: Any
    join: Callable[[Components], PyTree]
    args: PyTree

    @property
    def exists(self) -> bool:
        """Whether the field has one; see `AbstractImplicitField`."""
        return isinstance(self.field, AbstractImplicitField)

    def mass_matrix(self, y: Components) -> SparseMatrix:
        return self.field.mass_matrix(self.join(y), self.args)

    def residual(self, y: Components, rates: Components) -> Residual:
        return self.field.residual(self.join(y), self.join(rates), self.args)


class ImplicitJacobian(NamedTuple):
    """Mass matrix of the kept components, and derivatives of the residual: by kept and direct."""

    mass: SparseMatrix
    kept: SparseMatrix
    direct: SparseMatrix


class ImplicitLinearisation(AbstractLinearisation):
    """A field by its implicit form M ẏ = F, with the zeros of M and of F − M ẏ.

    With the derivatives A of F − M ẏ at fixed rates, (I − g J) u = r is (M − g A) u = M r.

    Attributes:
        form: of the field.
    """

    form: ImplicitForm

    def jacobian(self) -> ImplicitJacobian:
        kept, direct = self.kept(), self.direct()
        rates = self.evaluate(self.t, list(self.y))
        mass = dict(self.form.mass_matrix(list(self.y)))
        for i in kept:
            mass.setdefault((i, i), jnp.ones_like(self.y[i]))

        def missing(y: Components) -> Components:
            found = self.form.residual(y, rates)
            return [found[i] for i in kept]

        found = partial_derivatives(missing, list(self.y))
        entries = {(kept[i], j): entry for (i, j), entry in found.items()}
        return ImplicitJacobian(
            mass,
            {place: entry for place, entry in entries.items() if place[1] not in direct},
            {place: entry for place, entry in entries.items() if place[1] in direct},
        )

    def factorise(self, jacobian: ImplicitJacobian, step: Scalar) -> SparseFactors:
        sources, by_kept = self.direct(), dict(jacobian.kept)
        for (i, p), entry in jacobian.direct.items():
            place = i, sources[p]
            known = by_kept.get(place)
            by_kept[place] = step * entry if known is None else known + step * entry
        matrix = dict(jacobian.mass)
        for place, entry in by_kept.items():
            mass = matrix.get(place)
            matrix[place] = -(step * entry) if mass is None else mass - step * entry
        return factorise(matrix)

    def solve_kept(
        self, matrix: StepMatrix, right: Components, direct_right: dict[int, Scalar]
    ) -> Components:
        kept, (jacobian, step, factors) = self.kept(), matrix
        total = product(jacobian.mass, dict(zip(kept, right, strict=True)))
        for i, value in product(jacobian.direct, direct_right).items():
            total[i] = plus(total.get(i), times(step, value))
        return _filled(factors.solve(total), kept, step)

    def solution_matrices(self, matrix: StepMatrix) -> tuple[Scalar, Scalar]:
        kept, (jacobian, step, factors) = self.kept(), matrix

        def solved(columns: list[dict[int, Entry]]) -> Scalar:
            found = [_filled(factors.solve(column), kept, step) for column in columns]
            return jnp.stack([jnp.stack(column) for column in found], axis=1)

        mass, direct = jacobian.mass, jacobian.direct
        of_kept = [{i: mass.get((i, j)) for i in kept} for j in kept]
        of_direct = [{i: times(step, direct.get((i, p))) for i in kept} for p in self.direct()]
        return solved(of_kept), solved(of_direct) if of_direct else jnp.zeros((len(kept), 0))


def _filled(vector: dict[int, Entry], rows: list[int], like: Scalar) -> Components:
    """The entries in these rows, zeros too."""
    return [jnp.zeros_like(like) if (own := vector[i]) is None else own for i in rows]


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
    kind = DenseLinearisation if dense else ScalarLinearisation
    return kind(run, structure_of(program), t, tuple(y))

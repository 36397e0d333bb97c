"""Linearisation of a vector field by its implicit form, whose matrices have the zeros of a tree."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
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
from jaxbiped.solve.rosenbrock._abstract_linearisation import (
    AbstractLinearisation,
    Components,
    StepMatrix,
)


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
            moved = times(step, value)
            total[i] = plus(total.get(i), moved)
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

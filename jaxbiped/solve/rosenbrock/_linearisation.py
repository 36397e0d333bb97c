"""Linearisation of a vector field about a point: value, exact Jacobian, (I − g J)⁻¹ on vectors.

Which entries are zero by structure, to be left out, and which components are plain copies, is read
off the field's own program, or off its implicit form, whose matrices have the zeros of a tree.
"""

import abc
import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.extend
import jax.flatten_util
import jax.numpy as jnp
import jax.tree_util as jtu
from jax.extend.core import Jaxpr, JaxprEqn, Literal, Var
from jaxtyping import PyTree

from jaxbiped._jax_versions import ClosedJaxpr, called_program
from jaxbiped._types import Scalar
from jaxbiped.compiler import partial_derivatives
from jaxbiped.hybrid._implicit_field import ImplicitField, Residual
from jaxbiped.linalg._small_matrices import Matrix, inverse
from jaxbiped.linalg._sparse_lu import (
    Entry,
    SparseFactors,
    SparseMatrix,
    factorise,
    plus,
    product,
    times,
)

Components: TypeAlias = list[Scalar]
"""A point of the state space: its scalars one by one, or one vector that holds them all."""


class Structure(NamedTuple):
    """Structure of a function of scalars.

    Attributes:
        depends: for each output, the positions of the inputs that it can depend on.
        copies: for each output, the position of the input that it is a plain copy of, or None.
    """

    depends: tuple[frozenset[int], ...]
    copies: tuple[int | None, ...]


def structure_of(program: ClosedJaxpr) -> Structure:
    """Structure of a traced program. Conservative: a dependence may be reported in vain."""
    jaxpr = program.jaxpr
    inputs: list[frozenset[int]] = [frozenset([i]) for i in range(len(jaxpr.invars))]
    copies: list[int | None] = list(range(len(jaxpr.invars)))
    depends, copied = _propagate(jaxpr, inputs, copies)
    return Structure(tuple(depends), tuple(copied))


def _propagate(
    jaxpr: Jaxpr, inputs: list[frozenset[int]], copies: list[int | None]
) -> tuple[list[frozenset[int]], list[int | None]]:
    depends: dict[Var, frozenset[int]] = dict(zip(jaxpr.invars, inputs, strict=True))
    copied: dict[Var, int | None] = dict(zip(jaxpr.invars, copies, strict=True))

    def read(atom: Var | Literal) -> tuple[frozenset[int], int | None]:
        if isinstance(atom, Literal):
            return frozenset(), None
        return depends.get(atom, frozenset()), copied.get(atom)

    for equation in jaxpr.eqns:
        arguments = [read(atom) for atom in equation.invars]
        called = called_program(equation)
        if called is None:
            union: frozenset[int] = frozenset().union(*(used for used, _ in arguments))
            results = [union] * len(equation.outvars)
            source = arguments[0][1] if _is_copy(equation) else None
            results_copied: list[int | None] = [source] * len(equation.outvars)
        else:
            results, results_copied = _propagate(
                called[0], [used for used, _ in arguments], [source for _, source in arguments]
            )
        for variable, used, origin in zip(equation.outvars, results, results_copied, strict=True):
            depends[variable], copied[variable] = used, origin
    outputs = [read(atom) for atom in jaxpr.outvars]
    return [used for used, _ in outputs], [source for _, source in outputs]


def _is_copy(equation: JaxprEqn) -> bool:
    """Whether its result is its argument, as where only a weak type becomes a strong one."""
    if equation.primitive.name != "convert_element_type":
        return False
    before, after = (atom.aval for atom in (*equation.invars, *equation.outvars))
    return bool(before.dtype == after.dtype)  # type: ignore[attr-defined]


class StepMatrix(NamedTuple):
    """I − step J of a step, with what its `factorise` made of it."""

    jacobian: PyTree
    step: Scalar
    factors: PyTree


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
        self, matrix: StepMatrix, right: Components, direct_right: dict[int, Scalar]
    ) -> Components:
        """The kept components of (I − step J)⁻¹ r.

        `right` holds r of the kept components, `direct_right` of the direct ones.
        """

    @abc.abstractmethod
    def solution_matrices(self, matrix: StepMatrix) -> tuple[Scalar, Scalar]:
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


class DenseLinearisation(AbstractLinearisation):
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


class ScalarLinearisation(AbstractLinearisation):
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
                if source == j:
                    entry = plus(entry, times(step, jacobian[i][position]))
            scaled = times(step, entry)
            if i == j:
                row.append(jnp.ones_like(step) if scaled is None else 1.0 - scaled)
            else:
                row.append(None if scaled is None else -scaled)
        matrix.append(row)
    return matrix


_MOST_SCALARS = 24
"""Up to this size a Jacobian is eliminated scalar by scalar; beyond, as one dense matrix."""


def split(y: PyTree, field: object = None) -> tuple[Components, Callable[[Components], PyTree]]:
    """The components of `y` and the map back; scalars if `field` has an implicit form."""
    leaves, structure = jtu.tree_flatten(y)
    few = sum(jnp.size(leaf) for leaf in leaves) <= _MOST_SCALARS
    if not few and not isinstance(field, ImplicitField):
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
        """Whether the field has one; see `ImplicitField`."""
        return isinstance(self.field, ImplicitField)

    def mass_matrix(self, y: Components) -> SparseMatrix:
        return self.field.mass_matrix(self.args, self.join(y))

    def residual(self, y: Components, rates: Components) -> Residual:
        return self.field.residual(self.args, self.join(y), self.join(rates))


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

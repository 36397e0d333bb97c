"""Rosenbrock methods as diffrax solvers: implicit steps without iterations."""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from equinox.internal import ω
from jaxtyping import PyTree

from jaxbiped._types import BoolScalarLike, Scalar, SomeTree, Time
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import fusion_barrier
from jaxbiped.solve._stepper import Stepped, Tolerance
from jaxbiped.solve.rosenbrock._linearisation import (
    AbstractLinearisation,
    Components,
    ImplicitForm,
    StepMatrix,
    linearise,
    split,
)
from jaxbiped.solve.rosenbrock._tableau_form import (
    RosenbrockTableau,
    Row,
    direct_weights,
    error_weights,
    last_stage,
)

if TYPE_CHECKING:
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar


class RosenbrockInterpolation(diffrax.AbstractLocalInterpolation):
    """Dense output of a step, by a Rosenbrock or a Runge–Kutta method.

    With θ = (t − t0)/(t1 − t0): y = (1 − θ) y0 + θ (y1 + (1 − θ)(k_1 + θ (k_2 + θ k_3 …))).
    Without coefficients it is linear.

    Attributes:
        t0, t1: ends of the step [s].
        y0, y1: the solution at these ends.
        coefficients: k_1, k_2, … of the polynomial, each shaped as the solution.
    """

    t0: Time  # type: ignore[misc]
    t1: Time  # type: ignore[misc]
    y0: PyTree
    y1: PyTree
    coefficients: tuple[PyTree, ...]

    def evaluate(self, t0: Time, t1: Time | None = None, left: bool = True) -> PyTree:
        del left
        if t1 is not None:
            return (self.evaluate(t1) ** ω - self.evaluate(t0) ** ω).ω
        length = self.t1 - self.t0
        fraction = (t0 - self.t0) / jnp.where(length == 0.0, 1.0, length)

        def value(y0: Scalar, y1: Scalar, *coefficients: Scalar) -> Scalar:
            theta = jnp.asarray(fraction, dtype=y0.dtype)
            inner = coefficients[-1] if coefficients else jnp.zeros_like(y0)
            for coefficient in reversed(coefficients[:-1]):
                inner = coefficient + theta * inner
            return (1.0 - theta) * y0 + theta * (y1 + (1.0 - theta) * inner)

        return jtu.tree_map(value, self.y0, self.y1, *self.coefficients)


class AbstractMemorylessSolver(diffrax.AbstractAdaptiveSolver):  # type: ignore[type-arg]
    """A one-step solver that carries nothing from step to step.

    Attributes:
        term_structure: as in `diffrax.AbstractSolver`.
    """

    term_structure: ClassVar = diffrax.AbstractTerm

    def init(self, terms: Any, t0: Time, t1: Time, y0: PyTree, args: PyTree) -> None:
        return None

    def func(self, terms: Any, t0: Time, y0: PyTree, args: PyTree) -> PyTree:
        """The vector field at a point."""
        return terms.vf(t0, y0, args)


class AbstractRosenbrock(AbstractMemorylessSolver):
    """A Rosenbrock method: every step solves a few linear systems with one exact Jacobian.

    It accepts any pytree of real arrays. If the leaves are scalars, entries of the Jacobian that
    are zero by structure are left out, and a second-order system is reduced to the size of its
    velocities. A subclass only declares its tableau.

    Attributes:
        tableau: the method's coefficients.
        switch_weight: factor of the error estimate of a walk's step that crosses a switch.
        interpolation_cls: as in `diffrax.AbstractSolver`.
    """

    tableau: AbstractClassVar[RosenbrockTableau]
    switch_weight: ClassVar[float] = 1.0
    interpolation_cls: ClassVar[Callable[..., RosenbrockInterpolation]] = RosenbrockInterpolation

    def order(self, terms: Any) -> int:
        """Order of convergence."""
        return self.tableau.order

    @property
    def dense_count(self) -> int:
        """Number of coefficients of the states within a step."""
        return len(self.tableau.dense)

    def advance(
        self, terms: Any, t0: Time, t1: Time, y0: PyTree, args: PyTree, tolerance: Tolerance
    ) -> Stepped:
        """One step of a program; no tolerance decides on what it is."""
        del tolerance
        return Stepped(*step_of(self.tableau, terms, t0, t1, y0, args))

    def step(
        self,
        terms: Any,
        t0: Time,
        t1: Time,
        y0: PyTree,
        args: PyTree,
        solver_state: None,
        made_jump: BoolScalarLike,
    ) -> tuple[PyTree, PyTree, dict[str, PyTree], None, Any]:
        """One step, as `diffrax.AbstractSolver.step` describes it."""
        del solver_state, made_jump
        y1, error, coefficients, _ = _cached_step(self.tableau, terms, t0, t1, y0, args)
        dense_info = dict(y0=y0, y1=y1, coefficients=coefficients)
        return y1, error, dense_info, None, diffrax.RESULTS.successful


def step_of(
    tableau: RosenbrockTableau, terms: Any, t0: Time, t1: Time, y0: PyTree, args: PyTree
) -> tuple[PyTree, PyTree, tuple[PyTree, ...], PyTree]:
    """The new value, its error estimate, the dense output's coefficients, and the last argument.

    That is where the last stage evaluates the field: as far from the new value as its correction.
    """
    whole = _vector_field(terms)
    start, join = split(y0, whole)
    dtype = jnp.result_type(*start)

    def field(t: Scalar, y: Components) -> Components:
        return split(terms.vf(t, join(y), args), whole)[0]

    span = jnp.asarray(t1 - t0, dtype=dtype)
    control = jnp.asarray(terms.contr(t0, t1), dtype=dtype)
    form = ImplicitForm(whole, join, args)
    stages = stages_of(tableau, field, jnp.asarray(t0), start, span, control, form)
    last = _plus(start, stages.weighted(tableau.a[-1]))
    end = _plus(last, stages.weighted(last_stage(tableau)))
    error = stages.weighted(error_weights(tableau))
    dense = tuple(join(stages.weighted(row)) for row in tableau.dense)
    return join(end), join(error), dense, join(last)


def _vector_field(terms: Any) -> object:
    """The vector field of a term of diffrax, which integrates backwards by wrapping it."""
    while isinstance(terms, diffrax._term.WrapTerm):
        terms = terms.term
    return getattr(terms, "vector_field", None)


_cached_step = cached_jit(step_of)
"""Jitted for its cache alone: diffrax traces a step many times over, and this makes every time
but the first free."""


class Stages(NamedTuple):
    """The stages of a step, of which only the kept components are computed one by one.

    A direct component p, whose rate is the kept component s, obeys a linear recurrence: stage by
    stage (I − γ c) u_p = g (1 s_0 + (a + I) u_s), with g = γ h. So sums of its stages are sums of
    s_0 and u_s, with weights known from the tableau alone.
    """

    tableau: RosenbrockTableau
    start: Components
    step: Scalar
    step_matrix: StepMatrix
    lin: AbstractLinearisation
    direct: dict[int, int]
    kept: list[int]
    increments: list[Components]

    def weighted(self, weights: Sequence[float] | np.ndarray) -> Components:
        """Σ_j weights_j u_j for every component."""
        row = tuple(map(float, weights))
        totals: list[PyTree] = [None] * len(self.start)
        for place, i in enumerate(self.kept):
            totals[i] = _sum(row, [stage[place] for stage in self.increments])
        return [
            self._chain(row, self.direct[i]) if i in self.direct else total
            for i, total in enumerate(totals)
        ]

    def direct_right(self, i: int) -> dict[int, Scalar]:
        """Right-hand sides of the direct components in stage i."""
        unit = (0.0,) * i + (1.0,)
        return {p: self._chain(unit, s) for p, s in self.direct.items()}

    def _chain(self, row: Row, s: int) -> Scalar:
        """Σ_j row_j u_j of the component that follows s, by the stages of s there are so far."""
        at_start, *weights = direct_weights(self.tableau, row)
        place = self.kept.index(s)
        terms = [stage[place] for stage in self.increments[: len(row)]]
        return self.step * _sum([at_start, *weights], [self.start[s], *terms])


def stages_of(
    tableau: RosenbrockTableau,
    field: Callable[[Scalar, Components], Components],
    t: Scalar,
    start: Components,
    span: Scalar,
    control: Scalar,
    form: ImplicitForm | None = None,
) -> Stages:
    """All stages of a step.

    `span` is the step in the time that `field` sees and `control` the same step as the state sees
    it: opposite in sign where diffrax integrates backwards. `form` is the field's, if it has one.
    """
    lin = linearise(field, t, start, form)
    kept = lin.kept()
    step = tableau.gamma * control
    moves = control != 0.0

    def picked(components: list[SomeTree]) -> list[SomeTree]:
        return [components[i] for i in kept]

    slope, f_t, jacobian = fusion_barrier(
        moves,
        lambda: (picked(lin.evaluate(t, start)), picked(lin.time_derivative()), lin.jacobian()),
    )
    factors = fusion_barrier(moves, lambda: lin.factorise(jacobian, step))
    matrix = StepMatrix(jacobian, step, factors)
    stages = Stages(tableau, start, step, matrix, lin, lin.direct(), kept, increments=[])
    last_rate = slope

    def stage(i: int) -> tuple[Components, PyTree]:
        row_a, row_c = (tableau.a[i - 1], tableau.c[i - 1]) if i else ((), ())
        rate = slope
        if _repeats(tableau, i):
            rate = last_rate
        elif any(row_a):
            argument = _plus(start, stages.weighted(row_a))
            time = t + jnp.asarray(tableau.alpha[i] * span, dtype=t.dtype)
            rate = picked(lin.evaluate(time, argument))
        right = [step * component for component in rate]
        if any(row_c):
            weights = [tableau.gamma * c for c in row_c]
            extra = [_sum(weights, list(column)) for column in zip(*stages.increments, strict=True)]
            right = _plus(right, extra)
        weight = step * (tableau.gammas[i] * span)
        if tableau.gammas[i]:
            right = [r if d is None else r + weight * d for r, d in zip(right, f_t, strict=True)]
        kept_rate = rate if _repeats(tableau, i + 1) else None
        return lin.solve_kept(matrix, right, stages.direct_right(i)), kept_rate

    for i in range(len(tableau.alpha)):
        increment, last_rate = fusion_barrier(moves, functools.partial(stage, i))
        stages.increments.append(increment)
    return stages


def _repeats(tableau: RosenbrockTableau, i: int) -> bool:
    """Whether stage i evaluates the vector field where the stage before it did."""
    if not 2 <= i < len(tableau.alpha) or tableau.alpha[i] != tableau.alpha[i - 1]:
        return False
    return tableau.a[i - 1] == (*tableau.a[i - 2], 0.0)


def _sum(weights: Sequence[float], values: list[Scalar]) -> Scalar:
    """Σ weights_j values_j, zero weights left out and units not multiplied by."""
    terms = [v if w == 1.0 else float(w) * v for w, v in zip(weights, values, strict=False) if w]
    return functools.reduce(operator.add, terms) if terms else jnp.zeros_like(values[0])


def _plus(a: Components, b: Components) -> Components:
    return [x + y for x, y in zip(a, b, strict=True)]

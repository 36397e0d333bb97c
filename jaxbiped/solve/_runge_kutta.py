"""Runge–Kutta steppers for programs: explicit ones, and singly diagonally implicit ones.

The tableaux are diffrax's. A stage of an implicit method is found by simplified Newton iterations
with the Jacobian at the start of the step, as many as a fixed cap allows.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import optimistix
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar, Time
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import fusion_barrier
from jaxbiped.solve._stepper import Stepped, Stepper, Tolerance
from jaxbiped.solve.rosenbrock._linearisation import (
    AbstractLinearisation,
    Components,
    ImplicitForm,
    StepMatrix,
    linearise,
    split,
)
from jaxbiped.solve.rosenbrock._rosenbrock_solver import (
    AbstractRosenbrock,
    RosenbrockInterpolation,
)

_NEWTON_STEPS = 10
"""Most iterations for a stage, as in diffrax; a step with a stage that needs more is rejected."""
_STAGE_ERROR = 0.01
"""Change of a stage, in units of the tolerance, from which on it counts as found."""


def stepper_of(solver: diffrax.AbstractSolver[PyTree]) -> Stepper | None:
    """The stepper of programs that steps as a solver does; None where there is none."""
    kind = type(solver)
    if issubclass(kind, AbstractRosenbrock):
        return cast(AbstractRosenbrock, solver)
    if not kind.__module__.startswith("diffrax."):
        return None
    if kind is diffrax.Euler:
        return ExplicitStepper(kind)
    if not isinstance(getattr(kind, "tableau", None), diffrax.ButcherTableau):
        return None
    if issubclass(kind, diffrax.AbstractERK):
        return ExplicitStepper(kind)
    finder: Any = getattr(solver, "root_finder", None)
    # Tolerances of its own would be others than those of the programs' iterations.
    chord = isinstance(finder, optimistix.Chord | diffrax.VeryChord)
    usual = chord and not eqx.is_inexact_array_like(getattr(finder, "rtol", None))
    return ImplicitStepper(kind) if issubclass(kind, diffrax.AbstractESDIRK) and usual else None


class _Weights(NamedTuple):
    """Weights of the stages.

    Attributes:
        stages: in the stages from the second on.
        places: of these stages in the step.
        end: in the end.
        error: in its estimated error; zeros where there is no estimate.
    """

    stages: Sequence[np.ndarray]
    places: np.ndarray
    end: np.ndarray
    error: np.ndarray


def weights_of(kind: Any) -> _Weights:
    """The weights of a solver's class."""
    if kind is diffrax.Euler:  # which has no tableau
        return _Weights((), np.zeros(0), np.ones(1), np.zeros(1))
    tableau = kind.tableau
    return _Weights(tableau.a_lower, tableau.c, tableau.b_sol, tableau.b_error)


@dataclasses.dataclass(frozen=True)
class _AbstractRungeKutta:
    """What methods with a Butcher tableau share. Hashable.

    Attributes:
        kind: class of the solver of diffrax that it steps as.
    """

    switch_weight: ClassVar[float] = 1.0
    interpolation_cls: ClassVar[Callable[..., RosenbrockInterpolation]] = RosenbrockInterpolation
    kind: Any

    @property
    def dense_count(self) -> int:
        """Number of coefficients of the states within a step."""
        return len(dense_rows(self.kind))

    def error_order(self, terms: Any) -> RealScalarLike | None:
        """Order of the error estimate, as diffrax has it."""
        order: RealScalarLike | None = self.kind().error_order(terms)
        return order

    def _stepped(self, y0: PyTree, increments: list[PyTree]) -> Stepped:
        """The step that follows from the increments h f of its stages."""
        weights = weights_of(self.kind)
        error = _sum(weights.error, increments) if np.any(weights.error) else None
        dense = tuple(_sum(row, increments) for row in dense_rows(self.kind))
        end = _plus(y0, _sum(weights.end, increments))
        return Stepped(end, error, dense, None)


class ExplicitStepper(_AbstractRungeKutta):
    """An explicit Runge–Kutta method."""

    def advance(
        self, terms: Any, t0: Time, t1: Time, y0: PyTree, args: PyTree, tolerance: Tolerance
    ) -> Stepped:
        """One step."""
        del tolerance
        span, moves = t1 - t0, jnp.asarray(t1 != t0)
        weights = weights_of(self.kind)
        increments: list[PyTree] = []
        for i, place in enumerate([0.0, *map(float, weights.places)]):
            state = _plus(y0, _sum(weights.stages[i - 1], increments)) if i else y0
            time = t0 + place * span

            def increment(time: Time = time, state: PyTree = state) -> PyTree:
                return jtu.tree_map(lambda rate: span * rate, terms.vf(time, state, args))

            increments.append(fusion_barrier(moves, increment))
        return self._stepped(y0, increments)


class ImplicitStepper(_AbstractRungeKutta):
    """A method whose first stage is explicit, and all others share one diagonal coefficient."""

    def advance(
        self, terms: Any, t0: Time, t1: Time, y0: PyTree, args: PyTree, tolerance: Tolerance
    ) -> Stepped:
        """One step; its error is infinite where a stage was not found."""
        tableau, field = self.kind.tableau, terms.vector_field
        start, join = split(y0, field)
        inverse = split(tolerance.units.inverse, field)[0]
        begin, span = jnp.asarray(t0), jnp.asarray(t1 - t0)
        moves = span != 0.0
        lin = linearise(
            lambda t, y: split(terms.vf(t, join(y), args), field)[0],
            begin,
            start,
            ImplicitForm(field, join, args),
        )
        gamma = float(tableau.a_diagonal[-1])
        stages = _ImplicitStages(lin, span, gamma, _matrix(lin, gamma * span, moves))

        def change(kept: Components) -> Scalar:
            """Mean square of a change of the kept components, in units of the tolerance."""
            scales = [tolerance.atol / inverse[i] + tolerance.rtol * jnp.abs(start[i])
                      for i in lin.kept()]  # fmt: skip
            quotients = [gamma * value / scale for value, scale in zip(kept, scales, strict=True)]
            total = sum(jnp.sum(q * q) for q in quotients)
            return jnp.asarray(total / sum(map(jnp.size, quotients)))

        first = fusion_barrier(moves, lambda: lin.evaluate(begin, start))
        increments: list[Components] = [[span * rate for rate in first]]
        converged = jnp.asarray(True)
        rows = zip(tableau.a_lower, tableau.a_predictor, tableau.c, strict=True)
        for row, predictor, place in rows:
            base = _plus(start, _sum(row, increments))
            guess = _sum(predictor, increments)
            found, near = stages.solve(begin + float(place) * span, base, guess, change)
            increments.append(found)
            converged = converged & near
        end, error, dense, _ = self._stepped(start, increments)
        # Beyond doubt where steps have an error, and where they have none.
        end = [jnp.where(converged, value, jnp.nan) for value in end]
        error = [jnp.where(converged, value, jnp.inf) for value in error or ()]
        return Stepped(join(end), join(error), tuple(map(join, dense)), None)


@dataclasses.dataclass(frozen=True)
class _ImplicitStages:
    """The implicit stages of a step: K = h f(b + γ K).

    A direct component, whose rate is a kept one, follows from it: the Newton iterations are of the
    kept components alone.

    Attributes:
        lin: the field about the start of the step.
        span: h.
        gamma: the diagonal coefficient.
        matrix: I − h γ J.
    """

    lin: AbstractLinearisation
    span: Scalar
    gamma: float
    matrix: StepMatrix

    def solve(
        self,
        time: Scalar,
        base: Components,
        guess: Components,
        change: Callable[[Components], Scalar],
    ) -> tuple[Components, Scalar]:
        """The increments of a stage, and whether they were found."""
        kept = self.lin.kept()

        def iterate(found: Components) -> tuple[Components, Scalar]:
            whole = self._whole(base, found)
            argument = [b + self.gamma * k for b, k in zip(base, whole, strict=True)]
            rates = self.lin.evaluate(time, argument)
            residual = [self.span * rates[i] - k for i, k in zip(kept, found, strict=True)]
            moves = self.lin.solve_kept(self.matrix, residual, {})
            return _plus(found, moves), change(moves)

        def newton(_: Scalar, now: tuple[Components, Scalar]) -> tuple[Components, Scalar]:
            # Where it is found it stays: what is not a number never is.
            unknown = ~(now[1] < _STAGE_ERROR**2)
            return jax.lax.cond(unknown, lambda: iterate(now[0]), lambda: now)

        first = [guess[i] for i in kept], jnp.full_like(guess[0], jnp.inf)
        found, last = jax.lax.fori_loop(0, _NEWTON_STEPS, newton, first)
        return self._whole(base, found), last < _STAGE_ERROR**2

    def _whole(self, base: Components, kept: Components) -> Components:
        """All increments from the kept ones."""
        whole: list[Any] = [None] * len(base)
        for i, value in zip(self.lin.kept(), kept, strict=True):
            whole[i] = value
        for i, source in self.lin.direct().items():
            whole[i] = self.span * (base[source] + self.gamma * whole[source])
        return whole


def _matrix(lin: AbstractLinearisation, step: Scalar, moves: Scalar) -> StepMatrix:
    jacobian = fusion_barrier(moves, lin.jacobian)
    factors = fusion_barrier(moves, lambda: lin.factorise(jacobian, step))
    return StepMatrix(jacobian, step, factors)


@bounded_cache(PROGRAMS)
def dense_rows(kind: Any) -> np.ndarray:
    """Maps the s increments h f of a step to the coefficients of its dense output, shape (k, s).

    These are of `RosenbrockInterpolation`, and the polynomial is the one that diffrax has for the
    method, of which the values at some points of a step of length 1 tell.
    """
    weights = weights_of(kind).end
    if kind.interpolation_cls is diffrax.LocalLinearInterpolation:
        return np.zeros((0, len(weights)))
    points = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))

    with jax.ensure_compile_time_eval():
        ends = dict(t0=0.0, t1=1.0, y0=jnp.zeros(len(weights)), y1=jnp.asarray(weights))
        dense = kind.interpolation_cls(**ends, k=jnp.eye(len(weights)))
        found = np.stack([dense.evaluate(jnp.asarray(point)) for point in points])
    powers = np.linalg.solve(np.vander(points, increasing=True), found)
    # Less the straight line between the ends, over θ, over 1 − θ.
    powers[1] -= weights
    rows = np.cumsum(powers[1:-1], axis=0)
    degree = np.flatnonzero(np.max(np.abs(rows), axis=1) > 1e-11)
    return rows[: degree[-1] + 1]


_DEGREE = 7
"""Largest degree of a method's dense output."""


def _sum(weights: Sequence[float] | np.ndarray, values: Sequence[PyTree]) -> PyTree:
    """Σ weights_j values_j, zero weights left out."""
    pairs = [(float(w), v) for w, v in zip(weights, values, strict=False) if w != 0.0]
    if not pairs:
        return jtu.tree_map(jnp.zeros_like, values[0])
    (first, *factors), (leaf, *others) = zip(*pairs, strict=True)

    def total(leaf: Scalar, *others: Scalar) -> Scalar:
        found = first * leaf
        for factor, other in zip(factors, others, strict=True):
            found = found + factor * other
        return found

    return jtu.tree_map(total, leaf, *others)


def _plus(a: PyTree, b: PyTree) -> PyTree:
    return jtu.tree_map(lambda x, y: x + y, a, b)

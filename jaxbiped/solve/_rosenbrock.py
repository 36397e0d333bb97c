"""Rosenbrock methods as diffrax solvers: implicit steps without iterations."""

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeAlias

import diffrax
import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
from equinox.internal import ω
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.solve._fence import fenced
from jaxbiped.solve._linearisation import Components, linearise, split

if TYPE_CHECKING:
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar

Row: TypeAlias = tuple[float, ...]


class RosenbrockTableau(NamedTuple):
    """Coefficients of a stiffly accurate Rosenbrock method, in the form without products by J.

    With W = I − h γ J and f_t = ∂f/∂t, the stages are
    W u_i = γ (h f(t + α_i h, y + Σ_j a_ij u_j) + Σ_j c_ij u_j + γ_i h² f_t).
    The last stage's argument plus u_s is the new value.

    Source of the form: Hairer and Wanner, Solving Ordinary Differential Equations II, eq. IV.7.25.

    Attributes:
        gamma: diagonal coefficient γ.
        a: rows a_ij of the stages from the second on.
        c: rows c_ij of the stages from the second on.
        alpha: times α_i of the stages.
        gammas: coefficients γ_i of the time derivative.
        dense: rows that make the coefficients of the dense output from the stages.
        error: weights that make the error estimate from the stages; u_s where left empty.
    """

    gamma: float
    a: tuple[Row, ...]
    c: tuple[Row, ...]
    alpha: Row
    gammas: Row
    dense: tuple[Row, ...]
    error: Row = ()


class RosenbrockInterpolation(diffrax.AbstractLocalInterpolation):
    """Dense output of a Rosenbrock step.

    With θ = (t − t0)/(t1 − t0): y = (1 − θ) y0 + θ (y1 + (1 − θ)(k_1 + θ (k_2 + θ k_3 …))).
    """

    t0: Any  # type: ignore[misc]
    t1: Any  # type: ignore[misc]
    y0: PyTree
    y1: PyTree
    coefficients: tuple[PyTree, ...]

    def evaluate(self, t0: Any, t1: Any = None, left: bool = True) -> PyTree:
        del left
        if t1 is not None:
            return (self.evaluate(t1) ** ω - self.evaluate(t0) ** ω).ω
        length = self.t1 - self.t0
        fraction = (t0 - self.t0) / jnp.where(length == 0.0, 1.0, length)

        def value(y0: Scalar, y1: Scalar, *coefficients: Scalar) -> Scalar:
            theta = jnp.asarray(fraction, dtype=y0.dtype)
            inner = coefficients[-1]
            for coefficient in reversed(coefficients[:-1]):
                inner = coefficient + theta * inner
            return (1.0 - theta) * y0 + theta * (y1 + (1.0 - theta) * inner)

        return jtu.tree_map(value, self.y0, self.y1, *self.coefficients)


class AbstractRosenbrock(diffrax.AbstractAdaptiveSolver):
    """A Rosenbrock method: every step solves a few linear systems with one exact Jacobian.

    Works on any pytree of real arrays. Where the leaves are scalars, entries of the Jacobian
    that are zero by structure are left out, and a second-order system is reduced to the size of
    its velocities. A subclass only declares its tableau and order.
    """

    tableau: AbstractClassVar[RosenbrockTableau]
    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar[Callable[..., RosenbrockInterpolation]] = RosenbrockInterpolation

    def init(self, terms: Any, t0: Any, t1: Any, y0: PyTree, args: PyTree) -> None:
        """Rosenbrock methods carry nothing from step to step."""
        return None

    def func(self, terms: Any, t0: Any, y0: PyTree, args: PyTree) -> PyTree:
        """The vector field at a point."""
        return terms.vf(t0, y0, args)

    def step(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: PyTree,
        args: PyTree,
        solver_state: None,
        made_jump: Any,
    ) -> tuple[PyTree, PyTree, dict[str, Any], None, Any]:
        """One step, as `diffrax.AbstractSolver.step` describes it."""
        del solver_state, made_jump
        y1, error, coefficients = _step(self.tableau, terms, t0, t1, y0, args)
        dense_info = dict(y0=y0, y1=y1, coefficients=coefficients)
        return y1, error, dense_info, None, diffrax.RESULTS.successful


@eqx.filter_jit
def _step(
    tableau: RosenbrockTableau, terms: Any, t0: Any, t1: Any, y0: PyTree, args: PyTree
) -> tuple[PyTree, PyTree, tuple[PyTree, ...]]:
    """The new value, its error estimate and the coefficients of the dense output.

    Jitted for its cache alone: diffrax traces a step many times over, and this makes every time
    but the first free.
    """
    start, join = split(y0)
    dtype = jnp.result_type(*start)

    def field(t: Scalar, y: Components) -> Components:
        return split(terms.vf(t, join(y), args))[0]

    span = jnp.asarray(t1 - t0, dtype=dtype)
    control = jnp.asarray(terms.contr(t0, t1), dtype=dtype)
    stages, end = _stages(tableau, field, jnp.asarray(t0), start, span, control)
    dense = tuple(join(_weighted(row, stages)) for row in tableau.dense)
    error = _weighted(tableau.error, stages) if tableau.error else stages[-1]
    return join(end), join(error), dense


def _stages(
    tableau: RosenbrockTableau,
    field: Callable[[Scalar, Components], Components],
    t: Scalar,
    start: Components,
    span: Scalar,
    control: Scalar,
) -> tuple[list[Components], Components]:
    """All stages of a step and its new value.

    `span` is the step in the time that `field` sees and `control` the same step as the state sees
    it: opposite in sign where diffrax integrates backwards.
    """
    lin = linearise(field, t, start)
    step = tableau.gamma * control
    moves = control != 0.0
    slope, drift, jacobian = fenced(
        moves, lambda: (lin.evaluate(t, start), lin.time_derivative(), lin.jacobian())
    )
    factors = fenced(moves, lambda: lin.factorise(jacobian, step))
    stages: list[Components] = []
    value, last_rate = start, slope

    def stage(i: int) -> tuple[Components, Components, Components | None]:
        row_a, row_c = (tableau.a[i - 1], tableau.c[i - 1]) if i else ((), ())
        argument, rate = start, slope
        if _repeats(tableau, i):
            argument, rate = value, last_rate
        elif any(row_a):
            argument = _plus(start, _weighted(row_a, stages))
            time = t + jnp.asarray(tableau.alpha[i] * span, dtype=t.dtype)
            rate = lin.evaluate(time, argument)
        right = [step * component for component in rate]
        if any(row_c):
            right = _plus(right, _weighted([tableau.gamma * c for c in row_c], stages))
        weight = step * (tableau.gammas[i] * span)
        if tableau.gammas[i]:
            right = [r if d is None else r + weight * d for r, d in zip(right, drift, strict=True)]
        kept_rate = rate if _repeats(tableau, i + 1) else None
        return lin.solve(factors, jacobian, step, right), argument, kept_rate

    for i in range(len(tableau.alpha)):
        increment, value, last_rate = fenced(moves, functools.partial(stage, i))
        stages.append(increment)
    return stages, _plus(value, stages[-1])


def _repeats(tableau: RosenbrockTableau, i: int) -> bool:
    """Whether stage i evaluates the vector field where the stage before it did."""
    if not 2 <= i < len(tableau.alpha) or tableau.alpha[i] != tableau.alpha[i - 1]:
        return False
    return tableau.a[i - 1] == (*tableau.a[i - 2], 0.0)


def _weighted(weights: Sequence[float], stages: list[Components]) -> Components:
    """Σ_j weights_j stages_j, component by component, zero weights left out."""
    used = [(w, stage) for w, stage in zip(weights, stages, strict=False) if w != 0.0]
    totals = []
    for k in range(len(stages[0])):
        terms = [stage[k] if w == 1.0 else w * stage[k] for w, stage in used]
        total = terms[0]
        for term in terms[1:]:
            total = total + term
        totals.append(total)
    return totals


def _plus(a: Components, b: Components) -> Components:
    return [x + y for x, y in zip(a, b, strict=True)]

"""Tangent solver: state and derivatives stepped together, their errors controlled together.

A state within its tolerance does not make its derivatives accurate: they have a norm of their own.
"""

import functools
from collections.abc import Callable
from typing import Any, ClassVar, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import BoolScalarLike, RealScalarLike, Scalar, Time
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.solve._accuracy import rms_norm
from jaxbiped.solve._solvers import Projected
from jaxbiped.solve.controllers._wrapped_control import AbstractMemorylessControl, Adapted, Attempt
from jaxbiped.solve.rosenbrock._rosenbrock_solver import (
    AbstractMemorylessSolver,
    AbstractRosenbrock,
)
from jaxbiped.variational._rosenbrock_tangents import rosenbrock_tangents
from jaxbiped.variational._saltation import field_switch_values, saltation_at
from jaxbiped.variational._switch_locator import NEAR
from jaxbiped.variational._tangents import Seeded, Tangents, Watch, along_columns, as_columns

SHARE = 0.1
"""Of a column's largest entry: what its smaller entries' errors are measured against."""


class VariationalField(eqx.Module):
    """The vector field of `Tangents`: f, and J Y + f_p for the columns."""

    field: Callable[..., PyTree]

    def __call__(self, t: Time, y: Tangents, args: Seeded) -> Tangents:
        rate, columns = along_columns(lambda s, a: self.field(t, s, a), y, args)
        return Tangents(rate, as_columns(columns))


class TangentSolver(AbstractMemorylessSolver):
    """Steps a state and its columns: the columns by the exact derivative of the solver's step.

    They share the step's Jacobian and factorisation. Their error estimate is the derivative of
    the state's; `TangentControl` reads it. Steps forwards in time.

    Attributes:
        watch: with the state's own vector field, and its switches.
        solver: any one-step solver that carries nothing from step to step.
        columns_only_choose_steps: whether the columns only choose the steps and are not themselves
            differentiated: for reverse mode, whose derivatives then are these columns' transpose.
    """

    watch: Watch
    solver: diffrax.AbstractAdaptiveSolver[PyTree]
    columns_only_choose_steps: bool = eqx.field(static=True, default=False)
    interpolation_cls: ClassVar[type[diffrax.LocalLinearInterpolation]] = (
        diffrax.LocalLinearInterpolation
    )

    def order(self, terms: Any) -> int | None:
        return self.solver.order(terms)

    def error_order(self, terms: Any) -> RealScalarLike | None:
        return self.solver.error_order(terms)

    def step(
        self,
        terms: Any,
        t0: Time,
        t1: Time,
        y0: Tangents,
        args: Seeded,
        solver_state: None,
        made_jump: BoolScalarLike,
    ) -> tuple[Tangents, Tangents, dict[str, Tangents], None, Any]:
        """One step, as `diffrax.AbstractSolver.step` describes it."""
        del terms, solver_state
        y0 = with_saltation(self.watch, y0, args, made_jump)
        if self.columns_only_choose_steps:
            y1, error = _plain_step(self, t0, t1, y0.state, args.args)
            choosing, errors = jax.lax.stop_gradient(_tangent_step(self, t0, t1, y0, args))
            new, error = Tangents(y1, choosing.columns), Tangents(error, errors.columns)
        else:
            new, error = _tangent_step(self, t0, t1, y0, args)
        crosses = _crosses(self.watch, t1 - t0, y0.state, new.state, args.args)
        new, error = _columns_held(crosses, y0, new, error)
        return new, error, dict(y0=y0, y1=new), None, diffrax.RESULTS.successful


def _crosses(watch: Watch, span: Time, before: PyTree, after: PyTree, args: PyTree) -> Scalar:
    """Whether a step is the short one that crosses a switch where the field is not smooth.

    Its last stage lies behind, where the Jacobian may be any size: saltation is all that its
    columns change by.
    """
    ends = jax.lax.stop_gradient((before, after, args))
    old, new = (field_switch_values(watch, state, ends[2]) for state in ends[:2])
    changed = [(a > 0.0) != (b > 0.0) for a, b in zip(old, new, strict=True)]
    crossed = functools.reduce(jnp.logical_or, changed, jnp.asarray(False))
    return crossed & jax.lax.stop_gradient(jnp.asarray(span) <= 2.0 * NEAR)


def _columns_held(
    crosses: Scalar, before: Tangents, after: Tangents, error: Tangents
) -> tuple[Tangents, Tangents]:
    """A step and its error, but where it `crosses` derivatives are those of before, without any."""

    def held(old: Scalar, new: Scalar) -> Scalar:
        return jnp.where(crosses, old + jax.lax.stop_gradient(new - old), new)

    state = jtu.tree_map(held, before.state, after.state)
    columns = jnp.where(crosses, before.columns, after.columns)
    errors = jnp.where(crosses, 0.0, error.columns)
    return Tangents(state, columns), error._replace(columns=errors)


def with_saltation(watch: Watch, y: Tangents, args: Seeded, made_jump: BoolScalarLike) -> Tangents:
    """The columns behind a switch where the field is not smooth, if one has just been passed.

    The state stays what it is, but JAX's own derivatives of it jump as well.
    """
    if not field_switch_values(watch, y.state, args.args):
        return y
    still, held = jax.lax.stop_gradient((y.state, args))
    saltation = saltation_at(watch, still, held, jax.lax.stop_gradient(jnp.asarray(made_jump)))
    rows = saltation.by_state @ y.columns + saltation.by_parameter @ args.seeds
    leaves, structure = jtu.tree_flatten(y.state)
    zero_values = jnp.stack(field_switch_values(watch, y.state, args.args))
    zero_values = zero_values - jax.lax.stop_gradient(zero_values)
    shift = jnp.sum(jnp.where(saltation.which, zero_values, 0.0))
    jumped = [leaf + change * shift for leaf, change in zip(leaves, saltation.change, strict=True)]
    state = jtu.tree_unflatten(structure, jumped)
    return Tangents(state, y.columns + jnp.outer(saltation.change, rows))


def _plain_step(
    solver: TangentSolver, t0: Time, t1: Time, state: PyTree, args: PyTree
) -> tuple[PyTree, PyTree]:
    term = diffrax.ODETerm(solver.watch.field)
    y1, error, *_ = solver.solver.step(term, t0, t1, state, args, None, False)
    return y1, error


@cached_jit  # for its trace cache
def _tangent_step(
    solver: TangentSolver, t0: Time, t1: Time, y0: Tangents, args: Seeded
) -> tuple[Tangents, Tangents]:
    inner = solver.solver
    if isinstance(inner, Projected):
        adaptive = cast(diffrax.AbstractAdaptiveSolver[PyTree], inner.solver)
        bare = TangentSolver(solver.watch, adaptive, solver.columns_only_choose_steps)
        stepped, errors = _tangent_step(bare, t0, t1, y0, args)
        state, columns = along_columns(lambda s, a: inner.project(a, s), stepped, args)
        return Tangents(state, as_columns(columns)), errors
    if isinstance(inner, AbstractRosenbrock):
        found = rosenbrock_tangents(inner.tableau, solver.watch.field, t0, t1, y0, args)
        if found is not None:
            return found
    step = functools.partial(_plain_step, solver, t0, t1)
    (y1, error), (columns, column_errors) = along_columns(step, y0, args)
    return Tangents(y1, as_columns(columns)), Tangents(error, as_columns(column_errors))


class TangentControl(AbstractMemorylessControl):
    """Lets the columns' errors into a controller's norm, with a tolerance of their own.

    An entry's error is measured against its own size, a share of the largest entry of its column,
    and the column's floor, each in its leaf's unit: a column that is zero, or fades away, must not
    choose the steps. The wrapped controller's norm is `worst_norm`.

    Attributes:
        tangent_rtol: tolerance of the columns, relative.
        inverse_units: of the state's leaves, shape (c,).
    """

    tangent_rtol: RealScalarLike
    inverse_units: Scalar

    def adapt(self, attempt: Attempt) -> Adapted:
        inverse = self.inverse_units[:, None]
        size = jnp.maximum(jnp.abs(attempt.y0.columns), jnp.abs(attempt.y1.columns)) * inverse
        floor = SHARE * jnp.max(size, axis=0) + attempt.args.floors
        # The wrapped controller divides by its absolute tolerance; nothing else is left to it.
        scaled = (
            attempt.error.columns * inverse * (self.atol / (self.tangent_rtol * (size + floor)))
        )
        zero_error = jnp.zeros_like(scaled)
        return attempt.by(
            self.controller,
            y0=Tangents(attempt.y0.state, zero_error),
            y1=Tangents(attempt.y1.state, zero_error),
            args=None,
            error=Tangents(attempt.error.state, scaled),
        )


def worst_norm(error: PyTree) -> Scalar:
    """The largest root mean square among the state and each of its columns."""
    if not isinstance(error, Tangents):
        return rms_norm(error)
    squares = jnp.sum(error.columns * error.columns, axis=0) / error.columns.shape[0]
    return jnp.maximum(rms_norm(error.state), jnp.sqrt(jnp.max(squares)))

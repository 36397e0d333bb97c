"""Explicit Runge–Kutta step of a landing system, usually of order 8: its end and its error."""

import functools
import operator
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.hybrid._landing_system import LandingMotion
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._step_polynomials import Quintic

DOPRI8 = ExplicitMethod()
Rates = tuple[Scalar, ...]
"""Rates of the positions and of their rates."""


def explicit_step(
    motion: LandingMotion,
    state: Any,
    accelerations: tuple[Scalar, ...],
    step: Scalar,
    rtol: Scalar,
    *,
    method: ExplicitMethod = DOPRI8,
) -> tuple[Any, Scalar, list[Rates]]:
    """The state a step further, its error in units of the tolerance, and the rates of its stages.

    Those of the last stage are the state's, roughly.

    `accelerations` are those at the start. Of the error, the root mean square over positions and
    rates; infinite where it is no number.
    """
    (system, args), tableau = motion, method.tableau
    _, rates = system.coordinates(args, state)
    stages = jnp.stack([*rates, *accelerations])
    stages = jnp.pad(stages[None], ((0, len(tableau.stages)), (0, 0)))

    def stage(stages: Scalar, weights: Any) -> tuple[Scalar, None]:
        row, here = weights
        at = advance(motion, state, step, list(row), [tuple(rates) for rates in stages])
        _, moves = system.coordinates(args, at)
        rates = jnp.stack([*moves, *system.accelerations(args, at)])
        return jnp.where(here[:, None], rates, stages), None

    # A loop, which XLA compiles once; lanes write it out, without what is multiplied by zero.
    here = np.eye(len(tableau.stages) + 1, dtype=bool)[1:]
    stages, _ = jax.lax.scan(stage, stages, (tableau.stages.astype(stages.dtype), here))
    rows: list[Rates] = [tuple(row) for row in stages]
    end = advance(motion, state, step, tableau.end, rows)
    share = jnp.zeros_like(step)
    starts, ends = (sum(system.coordinates(args, y), ()) for y in (state, end))
    pairs = list(zip(starts, ends, strict=True))
    for i, (a, b) in enumerate(pairs if method.estimates else []):
        error = step * _weighted(tableau.error, rows, i)
        size = rtol * (0.01 + jnp.maximum(jnp.abs(a), jnp.abs(b)))
        share = share + (error / size) ** 2
    # A method without an estimate errs by one tolerance, as far as is known.
    error = jnp.sqrt(share / len(pairs)) if method.estimates else 1.0 + 0.0 * sum(end)
    return end, jnp.where(jnp.isnan(error), jnp.inf, error), rows


def within_step(
    motion: LandingMotion,
    step: Scalar,
    place: Scalar,
    before: tuple[Any, Rates],
    after: tuple[Any, Rates],
) -> Any:
    """The state at a share of a step, from states and accelerations at both ends: of order five."""
    system, args = motion
    ends = [(*system.coordinates(args, y), bends) for y, bends in (before, after)]
    positions, rates = [], []
    for old, new in zip(zip(*ends[0], strict=True), zip(*ends[1], strict=True), strict=True):
        position, slope, _ = Quintic.of(step, old, new).derivatives(place)
        positions.append(position)
        rates.append(slope / jnp.where(step == 0.0, 1.0, step))
    state = system.with_coordinates(args, before[0], (*positions, *rates))
    return system.later(args, state, lambda: place * step)


def advance(
    motion: LandingMotion,
    state: Any,
    step: Scalar,
    weights: Sequence[Any] | np.ndarray,
    stages: list[Rates],
) -> Any:
    """The state a step further, at weighted rates of its positions and of their rates."""
    system, args = motion
    old = sum(system.coordinates(args, state), ())
    new = tuple(x + step * _weighted(weights, stages, i) for i, x in enumerate(old))
    moved = system.with_coordinates(args, state, new)
    return system.later(args, moved, lambda: step * sum(weights))


def _weighted(weights: Sequence[Any] | np.ndarray, stages: list[Rates], i: int) -> Scalar:
    pairs = zip(weights, stages, strict=True)
    terms = [
        (weight if isinstance(weight, jax.Array) else float(weight)) * stage[i]
        for weight, stage in pairs
        if isinstance(weight, jax.Array) or weight != 0.0
    ]
    return functools.reduce(operator.add, terms)


def state_after(
    motion: LandingMotion,
    state: Any,
    accelerations: tuple[Scalar, ...],
    time: Scalar,
    method: ExplicitMethod = DOPRI8,
) -> Any:
    """The whole state so much later [s], by one step from a carried one and its accelerations."""
    # The tolerance scales the step's error, which is not asked.
    rtol = jnp.ones_like(time)
    end, *_ = explicit_step(motion, state, accelerations, time, rtol, method=method)
    return motion.system.completed(motion.args, end)

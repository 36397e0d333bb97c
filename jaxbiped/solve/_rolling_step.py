"""Rolling step: single support of the rigid walker by Dormand and Prince's method of order 8."""

import functools
import operator
from collections.abc import Sequence

import diffrax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.dynamics._rolling import rolling_rates
from jaxbiped.dynamics._state import RigidState
from jaxbiped.scene._scene import RigidScene

_TABLEAU = diffrax.Dopri8.tableau
ORDER = 8

Rates = tuple[Scalar, Scalar, Scalar, Scalar]
"""Rates of the angles and of their rates."""


def rolling_step(
    scene: RigidScene,
    state: RigidState,
    at_start: tuple[Scalar, Scalar],
    step: Scalar,
    rtol: Scalar,
    *,
    embedded: bool = False,
) -> tuple[RigidState, Scalar, Rates]:
    """The state a step further, its error in units of the tolerance, and its rates, roughly.

    `at_start` are the angular accelerations at the start. The place along the slope stays. Of the
    error, the root mean square over the components; infinite where it is no number. `embedded`:
    whether to go on with the embedded solution of order 7, by which the error is estimated: another
    method of steps, which a witness of errors takes.
    """
    stages: list[Rates] = [(state.omega_1, state.omega_2, *at_start)]
    for row in _TABLEAU.a_lower[:-1]:
        at = advance(state, step, row, stages)
        stages.append((at.omega_1, at.omega_2, *accelerations(scene, at)))
    weights = _TABLEAU.b_sol - _TABLEAU.b_error if embedded else _TABLEAU.b_sol
    end = advance(state, step, weights[:-1], stages)
    share = jnp.zeros_like(step)
    for i, (a, b) in enumerate(zip(state[1:], end[1:], strict=True)):
        error = step * _weighted(_TABLEAU.b_error[:-1], stages, i)
        size = rtol * (0.01 + jnp.maximum(jnp.abs(a), jnp.abs(b)))
        share = share + (error / size) ** 2
    error = jnp.sqrt(0.25 * share)
    return end, jnp.where(jnp.isnan(error), jnp.inf, error), stages[-1]


def accelerations(scene: RigidScene, state: RigidState) -> tuple[Scalar, Scalar]:
    """Angular accelerations of swing leg and stance leg [rad/s²]."""
    motion = rolling_rates(scene, state)
    return motion.alpha_1, motion.alpha_2


def advance(
    state: RigidState, step: Scalar, weights: Sequence[float] | np.ndarray, stages: list[Rates]
) -> RigidState:
    """The state a step further, at weighted rates of its angles and of their rates."""
    old = state[1:]
    new = (leaf + step * _weighted(weights, stages, i) for i, leaf in enumerate(old))
    return RigidState(state.hip_x, *new)


def _weighted(weights: Sequence[float] | np.ndarray, stages: list[Rates], i: int) -> Scalar:
    pairs = zip(weights, stages, strict=True)
    terms = [float(weight) * stage[i] for weight, stage in pairs if weight != 0.0]
    return functools.reduce(operator.add, terms)

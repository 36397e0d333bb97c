"""Gaits of the compliant walker under the seed's laws, found by Newton's method on footsteps."""

from typing import NamedTuple

import numpy as np

from .footstep import footstep

EXCHANGED = [1, 3, 2, 4, 5, 7, 6]
"""What recurs of a state, leg 2 now the one that stands."""


class Gait(NamedTuple):
    """A gait at mid-stance of leg 2, θ2 = 0.

    Attributes:
        state: hip z, θ1, θ2 and the rates, (7,).
        measures: period [s], step length [m], speed [m/s] and peak of the normal force [N].
        jacobian: of the return map, (7, 7).
        changes: derivatives of the fixed point along the directions, (7, k).
        elasticities: of the period's logarithm, (k,).
    """

    state: np.ndarray
    measures: np.ndarray
    jacobian: np.ndarray
    changes: np.ndarray
    elasticities: np.ndarray

    @property
    def radius(self) -> float:
        """Absolute value of the largest multiplier."""
        return float(np.max(np.abs(np.linalg.eigvals(self.jacobian))))


def turn(x: np.ndarray, p: np.ndarray, directions: np.ndarray | None = None) -> Gait:
    """The next mid-stance after x (7,), with a footstep's measures and derivatives.

    Those of the fixed point are along the directions in p, (k, SIZE), as if x were it.
    """
    along = np.zeros((0, len(p))) if directions is None else directions
    found = footstep(np.append(0.0, x), p, directions=along)
    t, length = found.time, found.state[0]
    reached, rows = found.state[EXCHANGED], found.gradient[EXCHANGED, 1:]
    jacobian, columns = rows[:, :7], rows[:, 7:]
    # How the fixed point moves, and the period with it.
    moved = np.linalg.solve(np.eye(7) - jacobian, columns)
    later = found.time_gradient[1:8] @ moved + found.time_gradient[8:]
    measures = np.array([t, length, length / t, found.peak])
    return Gait(reached, measures, jacobian, moved, later / t)


def gait(guess: np.ndarray, p: np.ndarray, directions: np.ndarray | None = None) -> Gait:
    """The gait near a state (7,) on the section; directions as for `turn`."""
    x = np.array(guess, float)
    for _ in range(12):
        next_ = turn(x, p, directions)
        step = np.linalg.solve(next_.jacobian - np.eye(7), next_.state - x)
        x = x - step
        if np.max(np.abs(step)) < 1e-11:
            return next_._replace(state=x)
    raise RuntimeError("no gait near the start")

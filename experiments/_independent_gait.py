"""The seed's gait by the independent equations and SciPy's Radau, its derivatives by differences.

Nothing of `jaxbiped` is used: a footstep ends where the leg that comes to stand passes the slope's
normal, Newton's method finds the footstep that repeats itself, and derivatives are central
differences of fourth order, of footsteps and of whole gaits.
"""

import math
from typing import NamedTuple

import _independent as eq
import numpy as np
from scipy.integrate import solve_ivp

EXCHANGED = [1, 3, 2, 4, 5, 7, 6]
"""What recurs of a state, leg 2 now the one that stands."""
FREE = [0, 1, 3, 4, 5, 6]
"""Of these, all but the stance angle, which is zero on the section."""
MID_SWING = 0.25
"""By then leg 1 has swung past the normal: it passes it again as the leg that stands [s]."""
STEP, LAW_STEP = 1e-4, 3e-3
"""Of differences by the state (in its own sizes) and by the logarithm of a law's number."""
CONVERGED = 1e-12


class Gait(NamedTuple):
    """Period [s], absolute value of the largest multiplier, elasticities by K, c and ξ."""

    period: float
    multiplier: float
    gradient: np.ndarray


def footstep(x: np.ndarray, rtol: float, laws: tuple[float, ...] = eq.LAWS):
    """The next state on the section (7,), and the time that it took [s]."""

    def passes(t, y, laws):
        return y[2] + (1.0 if t < MID_SWING else 0.0)

    passes.terminal, passes.direction = True, -1
    with np.errstate(over="ignore"):
        found = solve_ivp(
            eq.right_hand_side,
            (0.0, 1.0),
            np.concatenate([[0.0], x]),
            "Radau",
            rtol=rtol,
            atol=1e-2 * rtol,
            events=passes,
            args=(laws,),
        )
    return found.y_events[0][0][EXCHANGED], float(found.t_events[0][0])


def jacobian(x: np.ndarray, rtol: float) -> np.ndarray:
    """Derivative of a footstep with respect to what is free of the state, (6, 6)."""
    columns = []
    for k in FREE:
        h = STEP * np.eye(7)[k] * max(abs(x[k]), 0.1)
        up, down, above, below = (footstep(x + s * h, rtol)[0] for s in (1, -1, 2, -2))
        columns.append((8 * (up - down) - (above - below)) / (12 * h[k]))
    return np.stack(columns, axis=1)[FREE]


def converged(x: np.ndarray, slopes: np.ndarray, rtol: float, laws: tuple[float, ...]):
    """The footstep that repeats itself near x, by Newton's method with a kept derivative."""
    for _ in range(12):
        reached, _ = footstep(x, rtol, laws)
        change = np.linalg.solve(slopes - np.eye(6), (reached - x)[FREE])
        x = x.copy()
        x[FREE] -= change
        if np.max(np.abs(change)) < CONVERGED:
            break
    return x, footstep(x, rtol, laws)[1]


def gait(near: np.ndarray, rtol: float) -> Gait:
    """The gait near a state on the section (z, θ1, θ2 = 0 and rates), shape (7,)."""
    slopes = jacobian(near, rtol)
    x, period = converged(near, slopes, rtol, eq.LAWS)
    slopes = jacobian(x, rtol)
    multiplier = float(np.max(np.abs(np.linalg.eigvals(slopes))))
    gradient = []
    for k in range(3):

        def at(step: float, k: int = k) -> float:
            laws = list(eq.LAWS)
            laws[k] *= math.exp(step)
            return converged(x, slopes, rtol, tuple(laws))[1]

        h = LAW_STEP
        slope = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
        gradient.append(slope / period)
    return Gait(period, multiplier, np.array(gradient))

"""Another way to differentiate a footstep: differences of SciPy's solves.

As its users would write it: an event ends the solve where leg 1 is upright.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from _ball_ways import Answer, Run, relative_error
from _footstep_equations import LAWS, PARAMETERS, START
from _footstep_ways import INPUTS, UPRIGHT
from _independent import LAWS as STIFFNESS_DAMPING_DECAY
from _independent import right_hand_side
from scipy.integrate import solve_ivp

DIFFERENCES = (1e-4, 1e-5, 1e-6, 1e-7)
"""Of the start [SI], and of logarithms of parameters."""
LONGEST = 1.0
"""No footstep takes as long [s]."""


def by_scipy(truth: Answer, rtol: float) -> Run:
    """Central differences of Radau's solves, by the best of four steps: the truth chooses it."""

    def differences(step: float) -> Answer:
        columns = []
        for name in INPUTS:
            up, down = (_end(name, sign * step, rtol) for sign in (1.0, -1.0))
            columns.append((up - down) / (2.0 * step))
        return _without_upright(_end(INPUTS[0], 0.0, rtol), np.stack(columns, axis=1))

    def off(step: float) -> float:
        return relative_error(differences(step).gradient, truth.gradient)

    best = min(DIFFERENCES, key=off)
    return lambda: differences(best)


def _end(name: str, change: float, rtol: float) -> np.ndarray:
    """Time and state at the footstep's end, one input changed."""
    start, laws = START.copy(), LAWS.copy()
    if name in PARAMETERS:
        laws[PARAMETERS.index(name)] *= np.exp(change)
    else:
        start[1 + INPUTS.index(name)] += change
    numbers = (laws[0], laws[1], STIFFNESS_DAMPING_DECAY[2]), (laws[2], laws[3])

    def upright(t: float, y: np.ndarray, *_: Any) -> float:
        return y[UPRIGHT]

    upright.terminal, upright.direction = True, -1.0  # type: ignore[attr-defined]
    how: dict[str, Any] = dict(method="Radau", rtol=rtol, atol=1e-2 * rtol, events=upright)
    with np.errstate(over="ignore"):  # of columns of the Jacobian that are zero
        found = solve_ivp(right_hand_side, (0.0, LONGEST), start, args=numbers, **how)
    return np.append(found.t[-1], found.y[:, -1])


def _without_upright(ends: np.ndarray, rows: np.ndarray) -> Answer:
    at = UPRIGHT + 1
    return Answer(np.delete(ends, at), np.delete(rows, at, 0))


PEERS: tuple[tuple[str, str, tuple[float, ...], Callable[[Answer, float], Run]], ...] = (
    ("differences of SciPy's Radau", "rtol", (1e-4, 1e-6, 1e-8), by_scipy),
)
"""Name, what is varied, its values from rough to fine, and the way."""

"""Other ways to differentiate a footstep, and differences of SciPy's solves.

As its users would write these: an event ends the solve where leg 1 is upright.
"""

from collections.abc import Callable
from typing import Any

import diffrax
import numpy as np
from _casadi import by_cvodes
from _footstep_jax import KVAERNO5, by_diffrax, by_semi_implicit_euler
from _footstep_ways import INPUTS, UPRIGHT
from _gradient_ways import Answer, Run, Way, relative_error
from reference.compliant import numbers
from reference.footstep import LAWS, PARAMETERS
from reference.footstep import MID_STANCE as START
from reference.scipy_solves import solution

DIFFERENCES = (1e-4, 1e-5, 1e-6, 1e-7)
"""Of the start [SI], and of logarithms of parameters."""
LONGEST = 1.0
"""No footstep takes as long [s]."""


def differences_of(method: str) -> Callable[[Answer, float], Run]:
    """Central differences of a method's solves, by the best of four steps: the truth chooses it."""

    def prepare(truth: Answer, rtol: float) -> Run:
        def differences(step: float) -> Answer:
            columns = []
            for name in INPUTS:
                up, down = (_end(method, name, sign * step, rtol) for sign in (1.0, -1.0))
                columns.append((up - down) / (2.0 * step))
            middle = _end(method, INPUTS[0], 0.0, rtol)
            return _without_upright(middle, np.stack(columns, axis=1))

        def off(step: float) -> float:
            return relative_error(differences(step).gradient, truth.gradient)

        best = min(DIFFERENCES, key=off)
        return lambda: differences(best)

    return prepare


def _end(method: str, name: str, change: float, rtol: float) -> np.ndarray:
    """Time and state at the footstep's end, one input changed."""
    start, laws = START.copy(), LAWS.copy()
    if name in PARAMETERS:
        laws[PARAMETERS.index(name)] *= np.exp(change)
    else:
        start[1 + INPUTS.index(name)] += change
    moved = numbers(**dict(zip(PARAMETERS, laws, strict=True)))

    def upright(t: float, y: np.ndarray, *_: Any) -> float:
        return y[UPRIGHT]

    upright.terminal, upright.direction = True, -1.0  # type: ignore[attr-defined]
    found = solution(LONGEST, rtol, method=method, start=start, p=moved, events=upright)
    return np.append(found.t[-1], found.y[:, -1])


def _without_upright(ends: np.ndarray, rows: np.ndarray) -> Answer:
    at = UPRIGHT + 1
    return Answer(np.delete(ends, at), np.delete(rows, at, 0))


TOLERANCES, TIME_STEPS = (1e-4, 1e-6, 1e-8), (1e-4, 1e-5, 1e-6)
PEERS = (
    Way("diffrax Tsit5", "rtol", TOLERANCES, by_diffrax(diffrax.Tsit5())),
    Way("diffrax Kvaerno5", "rtol", TOLERANCES, by_diffrax(KVAERNO5)),
    Way("semi-implicit Euler in JAX", "dt", TIME_STEPS, by_semi_implicit_euler),
    Way("CasADi CVODES", "rtol", TOLERANCES, by_cvodes, "casadi"),
    Way("differences of SciPy's LSODA", "rtol", (*TOLERANCES, 1e-10), differences_of("LSODA")),
    Way("differences of SciPy's Radau", "rtol", TOLERANCES, differences_of("Radau")),
)

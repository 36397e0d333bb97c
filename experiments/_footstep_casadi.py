"""A footstep in CasADi's hands: CVODES with forward sensitivities to its start and its laws.

CVODES ends at a given time. As free end times are treated with it, time is scaled, and the
duration at which leg 1 is upright is found by Newton's method with its own sensitivity.
"""

from typing import Any

import _casadi
import numpy as np
from _footstep_ways import UPRIGHT
from _gradient_ways import Answer, Run
from reference.footstep import MID_STANCE as START

GUESS, ROUNDS = 0.44, 20


def by_cvodes(_: Answer, rtol: float) -> Run:
    """The derivative of the end by the implicit function theorem."""
    import casadi

    y, logs, span = casadi.SX.sym("y", 8), casadi.SX.sym("logs", 4), casadi.SX.sym("span")
    rates = _casadi.rates(casadi, y, _casadi.laws(casadi, logs))
    problem = dict(x=y, p=casadi.vertcat(logs, span), ode=span * rates)
    solver = casadi.integrator("footstep", "cvodes", problem, 0.0, 1.0, _casadi.options(rtol))
    end = solver.factory("end", ["x0", "p"], ["xf", "jac:xf:p"])
    whole = solver.factory("whole", ["x0", "p"], ["xf", "jac:xf:x0", "jac:xf:p"])

    def run() -> Answer:
        duration = GUESS
        for _ in range(ROUNDS):
            state, slopes = map(np.array, end(START, [0.0] * 4 + [duration]))
            change = state[UPRIGHT, 0] / slopes[UPRIGHT, -1]
            duration -= change
            if abs(change) < 1e-13:
                break
        found = whole(START, [0.0] * 4 + [duration])
        return _at_upright(duration, *map(np.array, found))

    return run


def _at_upright(duration: float, state: Any, by_start: Any, by_laws: Any) -> Answer:
    columns, velocity = np.hstack([by_start[:, 1:], by_laws[:, :-1]]), by_laws[:, -1]
    later = -columns[UPRIGHT] / velocity[UPRIGHT]
    rows = np.vstack([later, np.delete(columns + np.outer(velocity, later), UPRIGHT, 0)])
    return Answer(np.append(duration, np.delete(state.ravel(), UPRIGHT)), rows)

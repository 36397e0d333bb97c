"""The seed's walker in CasADi's hands: CVODES with forward sensitivities of walks and footsteps."""

import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np
from _gradient_ways import Answer, Run
from reference.compliant import SEED, START, numbers, on_numbers
from reference.footstep import LAWS, MID_STANCE, UPRIGHT


def sensitivities(duration: float, rtol: float) -> Callable[[], tuple[np.ndarray, np.ndarray]]:
    """A compiled solve: final state (8,) and its derivatives in log K, log c and log ξ (8, 3)."""
    import casadi

    y, logs = casadi.SX.sym("y", 8), casadi.SX.sym("logs", 3)
    stiffness, damping, decay = (
        SEED[name] * casadi.exp(logs[i]) for i, name in enumerate(("K", "c", "xi"))
    )
    seed = (stiffness, damping, SEED["mu_static"], SEED["mu_kinetic"], decay)
    problem = dict(x=y, p=logs, ode=rates(casadi, y, seed))
    solver = casadi.integrator("walk", "cvodes", problem, 0.0, duration, options(rtol))
    both = solver.factory("both", ["x0", "p"], ["xf", "jac:xf:p"])
    zero = np.zeros(3)

    def run() -> tuple[np.ndarray, np.ndarray]:
        state, slopes = both(START, zero)
        return np.array(state).ravel(), np.array(slopes)

    return run


def is_installed() -> bool:
    return importlib.util.find_spec("casadi") is not None


def options(rtol: float) -> dict[str, Any]:
    """Of CVODES: compiled, its sensitivities under the tolerance, too."""
    return dict(
        reltol=rtol, abstol=1e-2 * rtol, fsens_err_con=True, max_num_steps=1000000, jit=True,
        compiler="shell", jit_options=dict(flags="-O3 -march=native", verbose=False),
    )  # fmt: skip


def laws(casadi, logs):
    """K, c, both coefficients of friction, moved by logarithms, and ξ."""
    return *(value * casadi.exp(logs[i]) for i, value in enumerate(LAWS)), SEED["xi"]


def rates(casadi, y, laws):
    """Rates of the state (8,) by K, c, both coefficients of friction and ξ."""
    stiffness, damping, static, kinetic, decay = laws
    p, v0 = list(numbers()), SEED["v0"]
    equations = on_numbers(sin=casadi.sin, cos=casadi.cos)
    forces = []
    for leg in range(2):
        depth, sinking, slip = equations["foot"](y, leg, p)
        held = casadi.logic_and(depth > 0, y[6 + leg] < 0)
        deep = casadi.if_else(held, depth, 1.0)
        force = deep * (stiffness * casadi.sqrt(deep) + damping * sinking)
        normal = casadi.if_else(casadi.logic_and(held, force > 0), force, 0.0)
        speed = casadi.fabs(slip)
        rising = static * (1.0 - ((speed - v0) / v0) ** 2)
        falling = kinetic + (static - kinetic) * casadi.exp(-decay * casadi.fmax(speed - v0, 0.0))
        share = casadi.if_else(speed < v0, rising, falling)
        forces.append((-casadi.sign(slip) * share * normal, normal))
    moved = equations["accelerations"](y, p, *zip(*forces, strict=True), (0.0, 0.0))
    return casadi.vertcat(y[4], y[5], y[6], y[7], *moved)


GUESS, ROUNDS = 0.44, 20
"""Of a footstep's duration [s], and of Newton's method."""


def by_cvodes(_: Answer, rtol: float) -> Run:
    """A footstep differentiated, the derivative of its end by the implicit function theorem.

    CVODES ends at a given time. As free end times are treated with it, time is scaled, and the
    duration at which leg 1 is upright is found by Newton's method with its own sensitivity.
    """
    import casadi

    y, logs, span = casadi.SX.sym("y", 8), casadi.SX.sym("logs", 4), casadi.SX.sym("span")
    scaled = span * rates(casadi, y, laws(casadi, logs))
    problem = dict(x=y, p=casadi.vertcat(logs, span), ode=scaled)
    solver = casadi.integrator("footstep", "cvodes", problem, 0.0, 1.0, options(rtol))
    end = solver.factory("end", ["x0", "p"], ["xf", "jac:xf:p"])
    whole = solver.factory("whole", ["x0", "p"], ["xf", "jac:xf:x0", "jac:xf:p"])

    def run() -> Answer:
        duration = GUESS
        for _ in range(ROUNDS):
            state, slopes = map(np.array, end(MID_STANCE, [0.0] * 4 + [duration]))
            change = state[UPRIGHT, 0] / slopes[UPRIGHT, -1]
            duration -= change
            if abs(change) < 1e-13:
                break
        found = whole(MID_STANCE, [0.0] * 4 + [duration])
        return _at_upright(duration, *map(np.array, found))

    return run


def _at_upright(duration: float, state: Any, by_start: Any, by_laws: Any) -> Answer:
    columns, velocity = np.hstack([by_start[:, 1:], by_laws[:, :-1]]), by_laws[:, -1]
    later = -columns[UPRIGHT] / velocity[UPRIGHT]
    rows = np.vstack([later, np.delete(columns + np.outer(velocity, later), UPRIGHT, 0)])
    return Answer(np.append(duration, np.delete(state.ravel(), UPRIGHT)), rows)

"""The seed's walker in CasADi's hands: CVODES with forward sensitivities to K, c and ξ."""

import importlib.util
from collections.abc import Callable
from typing import Any

import _independent
import numpy as np


def sensitivities(duration: float, rtol: float) -> Callable[[], tuple[np.ndarray, np.ndarray]]:
    """A compiled solve: final state (8,) and its derivatives in log K, log c and log ξ (8, 3)."""
    import casadi

    y, logs = casadi.SX.sym("y", 8), casadi.SX.sym("logs", 3)
    stiffness, damping, decay = (
        value * casadi.exp(logs[i]) for i, value in enumerate(_independent.LAWS)
    )
    seed = (stiffness, damping, *_independent.COEFFICIENTS, decay)
    problem = dict(x=y, p=logs, ode=rates(casadi, y, seed))
    solver = casadi.integrator("walk", "cvodes", problem, 0.0, duration, options(rtol))
    both = solver.factory("both", ["x0", "p"], ["xf", "jac:xf:p"])
    zero = np.zeros(3)

    def run() -> tuple[np.ndarray, np.ndarray]:
        state, slopes = both(_independent.START, zero)
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
    w = _independent
    values = (w.STIFFNESS, w.DAMPING, w.STATIC, w.KINETIC)
    return *(value * casadi.exp(logs[i]) for i, value in enumerate(values)), w.DECAY


def rates(casadi, y, laws):
    """Rates of the state (8,) by K, c, both coefficients of friction and ξ."""
    w = _independent
    stiffness, damping, static, kinetic, decay = laws
    hip_z, vx, vz = y[1], y[4], y[5]
    arm, moment, total = w.LENGTH - w.RADIUS, w.MASS * w.CENTRE, 2.0 * w.MASS
    legs = []
    for angle, rate in ((y[2], y[6]), (y[3], y[7])):
        s, c = casadi.sin(angle), casadi.cos(angle)
        depth = w.RADIUS - (hip_z - arm * c)
        held = casadi.logic_and(depth > 0, rate < 0)
        deep = casadi.if_else(held, depth, 1.0)
        force = stiffness * deep * casadi.sqrt(deep) - damping * deep * (vz + arm * s * rate)
        normal = casadi.if_else(casadi.logic_and(held, force > 0), force, 0.0)
        slip = vx + arm * c * rate + w.RADIUS * rate
        speed = casadi.fabs(slip)
        rising = static * (1.0 - ((speed - w.PEAK_SPEED) / w.PEAK_SPEED) ** 2)
        beyond = casadi.fmax(speed - w.PEAK_SPEED, 0.0)
        falling = kinetic + (static - kinetic) * casadi.exp(-decay * beyond)
        size = normal * casadi.if_else(speed < w.PEAK_SPEED, rising, falling)
        along = -casadi.sign(slip) * size
        turn = moment * (c * w.PULL_X + s * w.PULL_Z)
        turn += arm * s * normal + (arm * c + w.RADIUS) * along
        legs.append((s, c, rate, along, normal, turn))
    push_x = total * w.PULL_X + sum(a + moment * s * r * r for s, _, r, a, _, _ in legs)
    push_z = total * w.PULL_Z + sum(n - moment * c * r * r for _, c, r, _, n, _ in legs)
    (s_1, c_1, *_, turn_1), (s_2, c_2, *_, turn_2) = legs
    share = moment / total
    turn_1 -= share * (c_1 * push_x + s_1 * push_z)
    turn_2 -= share * (c_2 * push_x + s_2 * push_z)
    own = w.INERTIA + moment * w.CENTRE - share * moment
    mixed = -share * moment * (c_1 * c_2 + s_1 * s_2)
    determinant = own * own - mixed * mixed
    alpha_1 = (own * turn_1 - mixed * turn_2) / determinant
    alpha_2 = (own * turn_2 - mixed * turn_1) / determinant
    ax = (push_x - moment * (c_1 * alpha_1 + c_2 * alpha_2)) / total
    az = (push_z - moment * (s_1 * alpha_1 + s_2 * alpha_2)) / total
    return casadi.vertcat(vx, vz, y[6], y[7], ax, az, alpha_1, alpha_2)

"""Heel strikes and energies of the independent equations' walk, by SciPy's methods."""

import itertools
import math
from typing import NamedTuple

import _independent as eq
import numpy as np
from scipy.integrate import solve_ivp

LEGS = ((2, 6), (3, 7))
"""Where a leg's angle and rate lie in the state."""


class Walk(NamedTuple):
    """A walk of the seed's: final state, times of heel strikes [s], and the energy ledger [J].

    The ledger is gravity's work, what dampers and friction lose, and the change of what is stored.
    """

    state: np.ndarray
    strikes: np.ndarray
    ledger: np.ndarray


@eq.compiled
def foot(y, angle, rate):
    """Penetration of a foot, its rate, slip, and forces along the slope and along its normal."""
    sine, cosine, arm = math.sin(angle), math.cos(angle), eq.LENGTH - eq.RADIUS
    along, normal = eq.contact(y[1], y[4], y[5], sine, cosine, rate)
    depth = eq.RADIUS - (y[1] - arm * cosine)
    sinking = -(y[5] + arm * sine * rate)
    slip = y[4] + arm * cosine * rate + eq.RADIUS * rate
    return depth, sinking, slip, along, normal


@eq.compiled
def with_powers(t, y):
    """Rates of the state, of the work that sinks a foot in, and of that lost to friction."""
    _, sinking_1, slip_1, along_1, normal_1 = foot(y, y[2], y[6])
    _, sinking_2, slip_2, along_2, normal_2 = foot(y, y[3], y[7])
    out = np.empty(10)
    out[:8] = eq.right_hand_side(t, y)
    out[8] = normal_1 * sinking_1 + normal_2 * sinking_2
    out[9] = -along_1 * slip_1 - along_2 * slip_2
    return out


def walk(duration: float, rtol: float, method: str = "Radau") -> Walk:
    """The seed's walk at a relative tolerance, the absolute one a hundredth of it."""
    start = np.concatenate([eq.START, np.zeros(2)])
    how = dict(method=method, rtol=rtol, atol=1e-2 * rtol, dense_output=True)
    with np.errstate(over="ignore"):
        found = solve_ivp(with_powers, (0.0, duration), start, **how)
    end = found.y[:, -1]
    (kinetic, lifted, pressed), first = energies(end), energies(start)
    gained = kinetic - first[0] + pressed - first[2]
    ledger = [first[1] - lifted, end[8] - (pressed - first[2]), end[9], gained]
    return Walk(end[:8], heel_strikes(found), np.array(ledger))


def energies(y: np.ndarray) -> tuple[float, float, float]:
    """Kinetic and gravitational energy, and that of the pressed ground [J]."""
    kinetic = lifted = pressed = 0.0
    for angle, rate in ((y[a], y[r]) for a, r in LEGS):
        sine, cosine = math.sin(angle), math.cos(angle)
        u, v = y[4] + eq.CENTRE * cosine * rate, y[5] + eq.CENTRE * sine * rate
        kinetic += 0.5 * (eq.MASS * (u * u + v * v) + eq.INERTIA * rate * rate)
        x, z = y[0] + eq.CENTRE * sine, y[1] - eq.CENTRE * cosine
        lifted -= eq.MASS * (eq.PULL_X * x + eq.PULL_Z * z)
        depth = foot(y, angle, rate)[0]
        if depth > 0.0 and rate < 0.0:
            pressed += eq.STIFFNESS * depth**2.5 / 2.5
    return kinetic, lifted, pressed


def touches(y: np.ndarray, leg: int) -> bool:
    """Whether a foot touches: in the ground and on its way back."""
    angle, rate = (y[k] for k in LEGS[leg])
    return bool(foot(y, angle, rate)[0] > 0.0 and rate < 0.0)


def heel_strikes(solution) -> np.ndarray:
    """Times at which the foot ahead comes to touch, the other one having struck before [s]."""
    states, times = solution.y.T, solution.t
    last, found = [touches(states[0], leg) for leg in (0, 1)].index(True), []
    for k, (before, after) in enumerate(itertools.pairwise(states)):
        other = 1 - last
        ahead = math.sin(after[LEGS[other][0]]) > math.sin(after[LEGS[last][0]])
        if touches(after, other) and not touches(before, other) and ahead:
            found.append(bisected(solution.sol, times[k], times[k + 1], other))
            last = other
    return np.array(found)


def bisected(dense, early: float, late: float, leg: int) -> float:
    """When a foot begins to touch, between two times [s]."""
    for _ in range(60):
        middle = 0.5 * (early + late)
        early, late = (early, middle) if touches(dense(middle), leg) else (middle, late)
    return late

"""Heel strikes and energies of the seed's walk, by SciPy's methods."""

import functools
import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from .compliant import START, compiled, contact, derivative, foot, numbers
from .scipy_solves import solution

SEED = numbers()


class Walk(NamedTuple):
    """A walk of the seed's.

    Attributes:
        state: at the end [SI], (8,).
        strikes: times of heel strikes [s].
        ledger: gravity's work, what dampers and friction lose, and the change of what is stored
            [J], by name.
        solution: as `solve_ivp` gives it, the state's eight numbers first.
    """

    state: np.ndarray
    strikes: np.ndarray
    ledger: dict[str, float]
    solution: Any


@compiled
def with_powers(t, y, p):
    """Rates of the state, of the work that sinks a foot in, and of that lost to friction."""
    out = np.zeros(10)
    out[:8] = derivative(t, y[:8], p)
    for leg in range(2):
        _, sinking, slip = foot(y, leg, p)
        along, normal, _ = contact(y[:8], leg, p)
        out[8] += normal * sinking
        out[9] -= along * slip
    return out


@functools.cache
def walk(duration: float, rtol: float, method: str = "Radau") -> Walk:
    """The seed's walk at a relative tolerance, the absolute one a hundredth of it."""
    start = np.concatenate([START, np.zeros(2)])
    how: dict[str, Any] = dict(method=method, dense_output=True, rates=with_powers)
    found = solution(duration, rtol, start=start, **how)
    end = found.y[:, -1]
    (kinetic, lifted, pressed), first = energies(end), energies(start)
    ledger = {
        "gravity_work": first[1] - lifted,
        "damper_loss": end[8] - (pressed - first[2]),
        "friction_loss": end[9],
        "stored_change": kinetic - first[0] + pressed - first[2],
    }
    return Walk(end[:8], heel_strikes(found), ledger, found)


def reference_states() -> tuple[np.ndarray, np.ndarray]:
    """Times and states (n, 8) of the seed's walk over 2 s, by Radau at 1e-11."""
    times = np.linspace(0.0, 2.0, 41)
    return times, walk(2.0, 1e-11).solution.sol(times)[:8].T


def energies(y: np.ndarray, p: np.ndarray = SEED) -> tuple[float, float, float]:
    """Kinetic and gravitational energy, and that of the pressed ground [J]."""
    kinetic = 0.5 * p[5] * (y[4] ** 2 + y[5] ** 2)
    lifted = -p[5] * (p[6] * y[0] + p[7] * y[1])
    pressed = 0.0
    for leg in range(2):
        sine, cosine, rate = math.sin(y[2 + leg]), math.cos(y[2 + leg]), y[6 + leg]
        u, v = y[4] + p[3] * cosine * rate, y[5] + p[3] * sine * rate
        kinetic += 0.5 * (p[0] * (u * u + v * v) + p[1] * rate * rate)
        lifted -= p[0] * (p[6] * (y[0] + p[3] * sine) + p[7] * (y[1] - p[3] * cosine))
        if touches(y, leg, p):
            depth = foot(y, leg, p)[0]
            pressed += p[10] * depth ** (p[12] + 1.0) / (p[12] + 1.0)
    return kinetic, lifted, pressed


def touches(y: np.ndarray, leg: int, p: np.ndarray = SEED) -> bool:
    """Whether a foot touches: in the ground and on its way back."""
    return bool(foot(y, leg, p)[0] > 0.0 and y[6 + leg] < 0.0)


def heel_strikes(solution: Any) -> np.ndarray:
    """Times at which the foot ahead comes to touch, the other one having struck before [s]."""
    states, times = solution.y.T, solution.t
    last, found = [touches(states[0], leg) for leg in (0, 1)].index(True), []
    for k, (before, after) in enumerate(itertools.pairwise(states)):
        other = 1 - last
        ahead = math.sin(after[2 + other]) > math.sin(after[2 + last])
        if touches(after, other) and not touches(before, other) and ahead:
            found.append(_touchdown(solution.sol, times[k], times[k + 1], other))
            last = other
    return np.array(found)


def _touchdown(dense: Any, early: float, late: float, leg: int) -> float:
    """When a foot begins to touch, between two times [s]."""
    for _ in range(60):
        middle = 0.5 * (early + late)
        early, late = (early, middle) if touches(dense(middle), leg) else (middle, late)
    return late

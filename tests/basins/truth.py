"""What becomes of starts, by SciPy's integrators and geometry alone."""

import numpy as np
from scipy.integrate import solve_ivp

from tests.reference import SEED, derivative
from tests.rigid_reference import _rates, coordinates, impact_solution

_LENGTH = SEED["l"] - SEED["r"]


def _depths(y):
    return [SEED["r"] - (y[1] - _LENGTH * np.cos(angle)) for angle in y[2:4]]


def _falls(_, y, p):
    """The hip below what a leg at one radian carries."""
    return y[1] - (SEED["r"] + _LENGTH * np.cos(1.0))


def _rests(_, y, p):
    """The rate of the leg that carries: of those under the ground the one that turns fastest."""
    under = [w for depth, w in zip(_depths(y), y[6:8], strict=True) if depth > 0.0]
    return min(under, default=-1.0)


def _passes(leg):
    def angle(_, y, p):
        return y[2 + leg] if _depths(y)[leg] > 0.0 and y[6 + leg] < 0.0 else 1.0

    angle.direction = -1
    return angle


def seed_fate(start, most_time):
    """In words, and when; of a walk, its states at mid-stance (n, 7), the carrying leg second."""
    _falls.terminal, _rests.terminal, _rests.direction = True, True, 1
    solved = solve_ivp(
        derivative, (0.0, most_time), start, "Radau", args=(SEED,), rtol=1e-6, atol=1e-8,
        events=(_falls, _rests, _passes(0), _passes(1)),
    )  # fmt: skip
    fell, rested, first, second = solved.t_events
    if len(fell):
        return "fell forward" if solved.y[4, -1] > 0.0 else "fell back", fell[0], None
    if len(rested):
        return "stopped", rested[0], None
    change = [0, 1, 3, 2, 4, 5, 7, 6]
    met = [(t, y[change]) for t, y in zip(first, solved.y_events[2], strict=True)]
    met += list(zip(second, solved.y_events[3], strict=True))
    met.sort(key=lambda each: each[0])
    return "walking", most_time, np.array([y[1:] for _, y in met])


def rigid_fate(scene, state, most):
    """In words, with the number of footsteps; of a walk, angles and rates after each (n, 4)."""
    _, theta, rates = coordinates(scene, state)
    met = []
    for count in range(most):

        def strikes(t, y):
            # Negative before the legs pass each other: what rises is no strike.
            return y[0] + y[1] if y[0] > y[1] else -1.0

        def forward(t, y):
            return y[1] + 1.0

        def back(t, y):
            return y[1] - 1.0

        for event in (strikes, forward, back):
            event.terminal = True
        strikes.direction = -1
        solved = solve_ivp(
            lambda t, y: _rates(scene, y), (0.0, 50.0), [*theta, *rates[2:], *rates[:2]],
            "DOP853", rtol=1e-8, atol=1e-10, events=(strikes, forward, back),
        )  # fmt: skip
        if len(solved.t_events[1]):
            return "fell forward", count, None
        if len(solved.t_events[2]):
            return "fell back", count, None
        y = solved.y[:, -1]
        after = impact_solution(scene, y[:2], y[[4, 5, 2, 3]])
        # The leg that struck stands from now on, and is the second.
        theta, rates = y[[1, 0]], after[[0, 1, 3, 2]]
        met.append([*theta, *rates[2:]])
    return "walking", most, np.array(met)

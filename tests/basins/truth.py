"""What becomes of starts of the seed's walker, by SciPy's integrators and geometry alone."""

import numpy as np
from reference.compliant import SEED, foot
from reference.scipy_solves import solution

_LENGTH = SEED["l"] - SEED["r"]


def _depths(y, p):
    return [foot(y, leg, p)[0] for leg in range(2)]


def _falls(_, y, p):
    """The hip below what a leg at one radian carries."""
    return y[1] - (SEED["r"] + _LENGTH * np.cos(1.0))


def _rests(_, y, p):
    """The rate of the leg that carries: of those under the ground the one that turns fastest."""
    under = [w for depth, w in zip(_depths(y, p), y[6:8], strict=True) if depth > 0.0]
    return min(under, default=-1.0)


def _passes(leg):
    def angle(_, y, p):
        return y[2 + leg] if _depths(y, p)[leg] > 0.0 and y[6 + leg] < 0.0 else 1.0

    angle.direction = -1
    return angle


def seed_fate(start, most_time):
    """In words, and when; of a walk, its states at mid-stance (n, 7), the carrying leg second."""
    _falls.terminal, _rests.terminal, _rests.direction = True, True, 1
    events = (_falls, _rests, _passes(0), _passes(1))
    solved = solution(most_time, 1e-6, start=np.asarray(start), events=events)
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

"""What becomes of a mechanism's starts, by a solver of others.

Judged by places and times of feet alone: neither a section nor a distance from the gait.
"""

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from scipy.integrate import odeint

from .mechanism_equations import Tree, contacts, hinges, motion_of
from .scipy_solves import silent

WALKING, FELL_FORWARD, FELL_BACK, OTHER = "walking", "fell forward", "fell back", "other"
LOW = math.cos(1.0)
"""Height of a fallen root point, of that in the zero pose."""
CYCLES, SAMPLES = 16, 100
"""Cycles that a start is followed, and states that are looked at in each."""
LIKE = 2e-2
"""How near the last cycle's time is to the gait's, relative, of a start that walks."""
Solve = Callable[[np.ndarray, np.ndarray], np.ndarray]


def lsoda_of(rates: Callable[..., None], rtol: float) -> Solve:
    """Motions by SciPy's LSODA: from a start and times to states (n, 2 k).

    Args:
        rates: a function (t, u, out, p) that writes the rates of u to out.
        rtol: relative tolerance, a hundred times the absolute one.
    """

    def field(t: float, y: np.ndarray) -> list[float]:
        out = [0.0] * len(y)
        rates(t, y.tolist(), out, None)
        return out

    def solve(start: np.ndarray, times: np.ndarray) -> np.ndarray:
        how = dict(tfirst=True, rtol=rtol, atol=1e-2 * rtol, mxstep=100_000)
        return odeint(field, start, times, **how)

    return solve


def fates(
    tree: Tree, starts: Iterable[Any], period: float, height: float, solve: Solve
) -> list[str]:
    """What becomes of each start.

    Args:
        tree: the mechanism.
        starts: states in its order, (n, 2 k).
        period: of the gait's cycle [s].
        height: of the root point in the zero pose [m].
        solve: see `lsoda_of`.
    """
    return [_fate(tree, np.asarray(each, float), period, height, solve) for each in starts]


def _fate(tree: Tree, y: np.ndarray, period: float, height: float, solve: Solve) -> str:
    times = np.linspace(0.0, period, SAMPLES + 1)
    whole = [y[None]]
    for _ in range(CYCLES):
        with silent(1, 2):  # what LSODA prints
            states = solve(whole[-1][-1], times)
        half = states.shape[1] // 2
        low = np.flatnonzero(states[:, 1] < LOW * height)
        if len(low):
            return FELL_FORWARD if states[low[0], half] >= 0.0 else FELL_BACK
        if len(states) < len(times) or not np.isfinite(states).all():
            return OTHER
        whole.append(states[1:])
    last = _last_cycle(tree, np.concatenate(whole), period / SAMPLES)
    return WALKING if abs(last - period) < LIKE * period else OTHER


def _last_cycle(tree: Tree, states: np.ndarray, pause: float) -> float:
    """Time between the last touchdowns ahead of both legs [s]; 0 where one makes none."""
    motion = motion_of(tree, states, tree.p)
    found, at = contacts(tree, motion, tree.p), hinges(tree, motion, tree.p)
    legs = [[k for k, own in enumerate(tree.legs) if own == leg] for leg in (0, 1)]
    touch = [np.any([found[k].depth > 0.0 for k in own], axis=0) for own in legs]
    place = [np.mean([(at[tree.feet[k]][0] + found[k].sole)[:, 0] for k in own], 0) for own in legs]
    lands = [
        np.flatnonzero(~touch[leg][:-1] & touch[leg][1:] & (place[leg] > place[1 - leg])[1:])
        for leg in (0, 1)
    ]
    return float(pause * abs(lands[0][-1] - lands[1][-1])) if all(map(len, lands)) else 0.0

"""Solves of the compliant walker: states by SciPy, and how well they are known.

Where SciPy's solves leave too much doubt, the motion is solved in multiple precision.
"""

import contextlib
import io
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import odeint, solve_ivp

from .compliant import START, derivative, jacobian, numbers
from .precise_solves import can_be_precise, precise_motion

_TOLERANCES = ((1e-13, 3e-12), (1e-11, 2e-10))
"""Relative tolerances of a solve and of the second one that it is held against; the looser two
where rounding stands in the way of the finer."""
FINEST = (1e-11, 1e-13)
"""Tolerances of a single solve that counts as exact."""
_NUDGE = 1e-14
"""Relative change of the second solve's start: what a chaotic motion makes of it counts."""
_SHORT = (0.0, 3e-7, 3e-6, 3e-5, 3e-4)
"""Shares of the time to leave out, and to make up for by the last rates, where no motion goes on at
the end: under the paper's clearance rule a leg that turns back in the ground may have none. The
least one counts that both solves come to the end of."""
_POINTS, _MOST = 120, 20000
"""Moments at which a solve is looked at, and its most steps between two of them."""


def solution(
    duration: float,
    rtol: float,
    atol: float | None = None,
    *,
    method: str = "Radau",
    start: np.ndarray = START,
    p: np.ndarray | None = None,
    rates: Callable[..., np.ndarray] = derivative,
    **options: Any,
) -> Any:
    """The motion by one of SciPy's methods, as `solve_ivp` gives it.

    Args:
        duration: simulated time [s].
        rtol, atol: tolerances, the absolute one a hundredth of the other unless given.
        method, options: of `solve_ivp`.
        start: the seed's unless given, SI units.
        p: numbers of the scene, see `compliant`; the seed's unless given.
        rates: of time, state and numbers.
    """
    how = dict(method=method, rtol=rtol, atol=1e-2 * rtol if atol is None else atol) | options
    numbers_of_it = (numbers() if p is None else p,)
    with np.errstate(over="ignore"):  # of columns of the Jacobian that are zero
        return solve_ivp(rates, (0.0, duration), start, args=numbers_of_it, **how)


def final_of(duration: float, rtol: float, atol: float | None = None, **options: Any) -> np.ndarray:
    """The state at the end of `solution`."""
    return solution(duration, rtol, atol, **options).y[:, -1]


class Checked(NamedTuple):
    """What the check knows of a motion.

    Attributes:
        state: at the end, shape (8,) or (10,) with bristles [SI].
        doubt: relative change of it by the second solve; infinite where either fails.
        lowest: least height of the hip over the one at which it has fallen, in units of l, before
            the last hundredth of the time.
        precise: whether it is from a solve in multiple precision.
    """

    state: np.ndarray
    doubt: float
    lowest: float
    precise: bool = False


def checked(start: np.ndarray, p: np.ndarray, duration: float, *, doubt: float = np.inf) -> Checked:
    """The motion from a start by these equations, with a second solve's doubt.

    Args:
        start: shape (8,), or (10,) with bristles, SI units.
        p: the numbers of the scene, see `compliant`.
        duration: simulated time [s].
        doubt: from which on a solve in multiple precision follows, where mpmath is installed.
    """
    found = _by_scipy(start, p, duration)
    if found.doubt <= doubt or not can_be_precise():
        return found
    units = scales(p, start.size)
    precise = precise_motion(start, p, duration, units)
    if not precise.doubt < found.doubt:
        return found
    lowest = (precise.lowest - _fallen_height(p)) / p[2]
    return Checked(precise.state, precise.doubt, lowest, True)


def _fallen_height(p: np.ndarray) -> float:
    """Height of the hip at which it counts as fallen [m]."""
    return float(p[4] + (p[2] - p[4]) * np.cos(1.0))


def _by_scipy(start: np.ndarray, p: np.ndarray, duration: float) -> Checked:
    units = scales(p, start.size)
    nudge = _NUDGE * units * np.where(np.arange(start.size) % 2, 1.0, -1.0)

    def both(time: float) -> tuple[np.ndarray, np.ndarray] | None:
        for fine, coarse in _TOLERANCES:
            first = _solved(start, p, time, fine, units, points=_POINTS)
            if first is None:
                continue
            second = _solved(start + nudge, p, time, coarse, units, points=_POINTS - 19)
            if second is not None:
                return first, second
        return None

    for short in _SHORT:
        found = both(duration * (1.0 - short))
        if found is not None:
            break
    else:
        return Checked(np.full(start.size, np.nan), np.inf, np.nan)
    for states in found:
        states[-1] += short * duration * derivative(0.0, states[-1], p)
    first, second = found
    before = first[: max(1, _POINTS * 99 // 100)]
    lowest = float(np.min(before[:, 1]) - _fallen_height(p)) / p[2]
    return Checked(first[-1], distance(first[-1], second[-1], units), lowest)


def states_of(
    start: np.ndarray, p: np.ndarray, duration: float, rtol: float, *, points: int
) -> np.ndarray:
    """States at equal moments, shape (points + 1, n); not numbers where the solve fails."""
    states = _solved(start, p, duration, rtol, scales(p, start.size), points=points)
    return np.full((points + 1, start.size), np.nan) if states is None else states


def scales(p: np.ndarray, size: int) -> np.ndarray:
    """Units of a state: l, √(g l), radians, √(g/l), and 1 for bristles."""
    length, gravity = p[2], np.hypot(p[6], p[7]) or 1.0
    time = np.sqrt(length / gravity)
    unit = np.ones(size)
    unit[:2], unit[4:6], unit[6:8] = length, length / time, 1.0 / time
    return unit


def distance(one: np.ndarray, other: np.ndarray, units: np.ndarray) -> float:
    """The largest difference of two states in their units; infinite where one is no number."""
    found = float(np.max(np.abs(one - other) / units))
    return found if np.isfinite(found) else np.inf


def _solved(
    start: np.ndarray,
    p: np.ndarray,
    duration: float,
    rtol: float,
    units: np.ndarray,
    *,
    points: int,
) -> np.ndarray | None:
    """States at equal moments, shape (points + 1, n); None where the solve fails."""
    times = np.linspace(0.0, duration, points + 1)
    with warnings.catch_warnings(), silent(1):
        warnings.simplefilter("ignore")
        states, told = odeint(
            derivative,
            start,
            times,
            args=(p,),
            Dfun=jacobian,
            tfirst=True,
            rtol=rtol,
            atol=1e-2 * rtol * units,
            mxstep=_MOST,
            hmax=duration / points,
            full_output=True,
        )
    good = told["message"] == "Integration successful." and np.all(np.isfinite(states))
    return states if good else None


@contextlib.contextmanager
def silent(*streams: int) -> Iterator[None]:
    """LSODA prints from C: what goes to these streams meanwhile is lost."""
    kept = [os.dup(stream) for stream in streams]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    sys.stdout.flush()
    try:
        for stream in streams:
            os.dup2(nowhere, stream)
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        for stream, old in zip(streams, kept, strict=True):
            os.dup2(old, stream)
            os.close(old)
        os.close(nowhere)

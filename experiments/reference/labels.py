"""Labels of starts of the seed's walker: LSODA in pieces, judged after each.

Of jaxbiped only the gait's point, metric and radius are used.
"""

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .compliant import SEED as PARAMETERS
from .compliant import compiled, derivative, foot, numbers
from .numbalsoda_solves import lsoda_address
from .scipy_solves import silent, solution

SEED = numbers()
RADIUS, ARM = PARAMETERS["r"], PARAMETERS["l"] - PARAMETERS["r"]
UNIT = math.sqrt(PARAMETERS["g"] / PARAMETERS["l"])
PIECE, SAMPLES = 0.44, 23
"""A footstep's time [s], and how many states are looked at in it."""
FOOTSTEPS, PATIENCE = 30, 50.0 / UNIT
WALKING, FELL_FORWARD, FELL_BACK, STOPPED, STUMBLED, FAILED = 0, 1, 2, 3, 4, 6
UNRESOLVED, TIMED_OUT, GOING_ON = 8, 9, -1
MOST_STEPS = 500
"""Between two states that are looked at: more are taken only where the motion cannot go on."""


@compiled
def depth(y, leg):
    """How far a foot is under the ground [m]."""
    return foot(y, leg, SEED)[0]


@compiled
def carrying(y):
    """The leg that stands alone: 0 or 1; −1 for none, 2 for both."""
    first = depth(y, 0) > 0.0 and y[6] < 0.0
    second = depth(y, 1) > 0.0 and y[7] < 0.0
    if first and second:
        return 2
    return 0 if first else (1 if second else -1)


@compiled
def ending(y):
    """How a state has ended, by its geometry alone."""
    if not math.isfinite(y.sum()):
        return FAILED
    if y[1] < RADIUS + ARM * math.cos(1.0):
        return FELL_FORWARD if y[4] >= 0.0 else FELL_BACK
    stands = carrying(y)
    if stands == -1:
        for leg in range(2):
            if depth(y, leg) > 0.0 and 0.0 <= y[6 + leg] < 0.1 * UNIT:
                return STOPPED
    elif stands < 2 and y[6 + stands] > -1e-4 * UNIT:
        return STOPPED
    return GOING_ON


@compiled
def mid_stance(a, b, span, leg):
    """The state where a standing leg is upright, by Hermite's cubic between two states."""
    at_a, at_b = derivative(0.0, a, SEED), derivative(0.0, b, SEED)
    low, high = 0.0, 1.0
    here = np.empty(8)
    for _ in range(40):
        s = 0.5 * (low + high)
        for i in range(8):
            rise = b[i] - a[i]
            p, q = span * at_a[i], span * at_b[i]
            here[i] = a[i] + s * (p + s * (3.0 * rise - 2.0 * p - q + s * (p + q - 2.0 * rise)))
        if here[2 + leg] > 0.0:
            low = s
        else:
            high = s
    return here


@compiled
def distance(y, leg, point, metric):
    """From the gait on its section, in its metric; `leg` stands."""
    other = 1 - leg
    x = np.array([y[1], y[2 + other], y[2 + leg], y[4], y[5], y[6 + other], y[6 + leg]]) - point
    total = 0.0
    for row in metric:
        total += (row * x).sum() ** 2
    return math.sqrt(total)


@compiled
def judged(states, span, memory, point, metric, radius):
    """The label after a piece, or that it goes on.

    `memory`: leg that stood last, footsteps, time since the last, distance from the gait then.
    """
    for k in range(1, len(states)):
        y, before = states[k], states[k - 1]
        code = ending(y)
        if code != GOING_ON:
            return code
        memory[2] += span
        stands, stood = carrying(y), int(memory[0])
        if stands in (0, 1):
            if stood in (0, 1) and stands != stood:
                ahead = math.sin(y[2 + stands]) > math.sin(y[2 + stood])
                if not ahead:
                    return STUMBLED
                memory[1] += 1.0
                memory[2] = 0.0
            elif stood == stands and before[2 + stands] > 0.0 >= y[2 + stands]:
                here = distance(mid_stance(before, y, span, stands), stands, point, metric)
                if here < radius and here < memory[3]:
                    return WALKING
                memory[3] = here
            memory[0] = stands
        if memory[1] >= FOOTSTEPS:
            return UNRESOLVED
        if memory[2] > PATIENCE:
            return TIMED_OUT
    return GOING_ON


def by_scipy(starts: np.ndarray, attractor: Any, rtol: float) -> np.ndarray:
    """Labels of starts (n, 8), by SciPy's LSODA; a piece that it gives up is a failure."""
    times = np.linspace(0.0, PIECE, SAMPLES)
    codes = []
    for start in starts:
        memory, y, code = np.array([-1.0, 0.0, 0.0, np.inf]), start, GOING_ON
        while code == GOING_ON:
            found = solution(PIECE, rtol, method="LSODA", start=y, t_eval=times)
            states = np.ascontiguousarray(found.y.T)
            complete = len(states) == SAMPLES
            code = judged(states, times[1], memory, *_of(attractor)) if complete else FAILED
            y = states[-1]
        codes.append(code)
    return np.array(codes)


def by_numbalsoda(starts: np.ndarray, attractor: Any, rtol: float) -> np.ndarray:
    """Labels of starts (n, 8), by numbalsoda on all of numba's threads."""
    with silent(1, 2):  # what LSODA prints
        return _batch()(starts, np.linspace(0.0, PIECE, SAMPLES), rtol, *_of(attractor))


def _of(attractor: Any) -> tuple[np.ndarray, np.ndarray, float]:
    return attractor.point, np.ascontiguousarray(attractor.metric), attractor.radius


@functools.cache
def _batch() -> Callable[..., np.ndarray]:
    import numba
    from numbalsoda import lsoda

    address = lsoda_address()

    @numba.njit
    def stuck(y, pause, rtol):
        """How a piece ended that has no continuation: a swing leg barred by the ground."""
        times = np.array([0.0, pause])
        for _ in range(SAMPLES):
            states, done = lsoda(address, y, times, np.array([0.0]), rtol, 1e-2 * rtol, MOST_STEPS)
            if not done:
                break
            y = states[-1].copy()
            code = ending(y)
            if code != GOING_ON:
                return code
        for leg in range(2):
            if depth(y, leg) > 0.0 and y[6 + leg] >= 0.0:
                ahead = math.sin(y[2 + leg]) > math.sin(y[3 - leg])
                return FELL_FORWARD if ahead else STUMBLED
        return FAILED

    @numba.njit(parallel=True)
    def batch(starts, times, rtol, point, metric, radius):
        codes = np.empty(len(starts), dtype=np.int64)
        for i in numba.prange(len(starts)):
            memory = np.array([-1.0, 0.0, 0.0, np.inf])
            y, code = starts[i].copy(), GOING_ON
            while code == GOING_ON:
                states, done = lsoda(
                    address, y, times, np.array([0.0]), rtol, 1e-2 * rtol, MOST_STEPS
                )
                if done:
                    code = judged(states, times[1], memory, point, metric, radius)
                    y = states[-1].copy()
                else:
                    code = stuck(y, times[1], rtol)
            codes[i] = code
        return codes

    return batch

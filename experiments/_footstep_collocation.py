"""A footstep and its derivatives, by equations and a method that nothing else here has.

The seed's walker from mid-stance to mid-stance, one heel strike between: its time, its end, and
their derivatives with respect to the start and the logarithms of K, c and both coefficients of
friction. Steps are Radau IIA collocation of high order on one smooth piece of the laws at a time.
Every surface between pieces is located, tangents jump there by saltation, and are carried by the
equations that the collocation's own solution satisfies. Jacobians are complex steps: exact.
"""

import functools
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize
from _footstep_equations import (
    FREE,
    LAWS,
    NAMES,
    PRESSING,
    START,
    Pieces,
    band_of,
    compiled,
    field,
    foot,
    slopes,
    surface_slopes,
    surfaces,
)
from mpmath import mp

FIRST_STEP, GROWTH = 1e-10, 2.5
"""Steps after a switch begin so small [s] that a root's singularity at touchdown is graded away."""


class Footstep(NamedTuple):
    """A footstep and its derivatives, at its end where leg 1 passes the slope's normal.

    Attributes:
        time: [s]. state: at its end, the eight numbers of the state, legs not renamed.
        time_gradient: of the time, with respect to the start (8) and the logarithms of the laws.
        gradient: of the state at the end, (8, 12).
        switches: names of the surfaces that were met, in order, with their times [s].
        steps: how many it took.
    """

    time: float
    state: np.ndarray
    time_gradient: np.ndarray
    gradient: np.ndarray
    switches: list[tuple[str, float]]
    steps: int


@functools.cache
def radau(stages: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes (s,) and matrix (s, s) of Radau IIA, and the row that gives the last Legendre mode."""
    with mp.workdps(50):
        legendre = [
            mp.taylor(lambda x, n=n: mp.legendre(n, x), 0, stages) for n in range(stages + 1)
        ]
        poly = [a - b for a, b in zip(legendre[stages], legendre[stages - 1], strict=True)]
        roots = sorted(mp.re(root) for root in mp.polyroots(poly[::-1], 200, extraprec=200))
        nodes = [(root + 1) / 2 for root in roots]
        powers = mp.matrix(stages, stages)
        integrals = mp.matrix(stages, stages)
        for i, node in enumerate(nodes):
            for k in range(stages):
                powers[i, k] = node**k
                integrals[i, k] = node ** (k + 1) / (k + 1)
        inverse = powers**-1
        matrix = integrals * inverse
        # The coefficient of x^(s-1), as that of the Legendre polynomial of this degree on (0, 1).
        last = inverse[stages - 1, :] / mp.binomial(2 * stages - 2, stages - 1)
        as_array = lambda m: np.array([[float(x) for x in row] for row in m.tolist()])  # noqa: E731
        return np.array([float(n) for n in nodes]), as_array(matrix), as_array(last)[0]


@compiled
def collocate(y, h, laws, pressing, band, nodes, matrix):
    """States at the stages of one step (s, 8), and whether Newton's method converged."""
    s = len(nodes)
    first = field(y, laws, pressing, band)
    at = np.empty((s, 8))
    for i in range(s):
        at[i] = y + nodes[i] * h * first
    change = np.inf
    for _ in range(30):
        system, left = np.eye(8 * s), np.empty(8 * s)
        rates = np.empty((s, 8))
        for j in range(s):
            rates[j] = field(at[j], laws, pressing, band)
            own = slopes(at[j], laws, pressing, band)[:, :8]
            for i in range(s):
                system[8 * i : 8 * i + 8, 8 * j : 8 * j + 8] -= h * matrix[i, j] * own
        for i in range(s):
            total = y - at[i]
            for j in range(s):
                total = total + h * matrix[i, j] * rates[j]
            left[8 * i : 8 * i + 8] = total
        if not (np.isfinite(left).all() and np.isfinite(system).all()):
            return at, False
        step = np.linalg.solve(system, left)
        at += step.reshape((s, 8))
        before, change = change, np.max(np.abs(step))
        if not np.isfinite(change):
            return at, False
        if change < 1e-15 or (change < 1e-11 and change > 0.5 * before):
            return at, True
    return at, False


@compiled
def carry(w, at, h, laws, pressing, band, matrix):
    """Tangents at the stages (s, 8, 12): what the collocation's solution changes by."""
    s = len(at)
    system, left = np.eye(8 * s), np.empty((8 * s, 12))
    every = np.empty((s, 8, 12))
    for j in range(s):
        every[j] = slopes(at[j], laws, pressing, band)
    for i in range(s):
        total = w.copy()
        for j in range(s):
            total[:, 8:] += h * matrix[i, j] * every[j][:, 8:]
            system[8 * i : 8 * i + 8, 8 * j : 8 * j + 8] -= h * matrix[i, j] * every[j][:, :8]
        left[8 * i : 8 * i + 8] = total
    return np.linalg.solve(system, left).reshape((s, 8, 12))


def footstep(
    start: np.ndarray = START, laws: Any = LAWS, *, stages: int = 7, resolution: float = 1e-9
) -> Footstep:
    """A footstep and its derivatives.

    Args:
        start: at mid-stance of leg 2. laws: K, c and both coefficients of friction.
        stages: of the collocation, whose order is twice that less one.
        resolution: what its last Legendre mode may have of state and tangents.
    """
    nodes, matrix, last = radau(stages)
    laws = np.asarray(laws, float)
    y, w = np.array(start, float), np.hstack([np.eye(8), np.zeros((8, 4))])
    pieces = Pieces(np.array([FREE, PRESSING]), np.array([0, band_of(foot(y, 1)[2])]))
    t, h, met, steps = 0.0, FIRST_STEP, [], 0
    while t < 2.0:
        trial, converged = collocate(y, h, laws, *pieces, nodes, matrix)
        size = _unresolved(last, trial) if converged else np.inf
        if size > resolution:
            h *= 0.5 if not converged else max(0.2, 0.9 * (resolution / size) ** (1.0 / stages))
            continue
        which, span = _first_crossing(y, trial, h, laws, pieces, nodes, matrix)
        if which is not None and span < h:
            trial, _ = collocate(y, span, laws, *pieces, nodes, matrix)
        moved = carry(w, trial, span, laws, *pieces, matrix)
        rough = max(_unresolved(last, trial), _unresolved(last, moved))
        if rough > resolution:
            h = span * max(0.2, 0.9 * (resolution / rough) ** (1.0 / stages))
            continue
        y, w, t, steps = trial[-1], moved[-1], t + span, steps + 1
        room = (resolution / max(rough, 1e-30)) ** (1.0 / stages)
        h = span * min(GROWTH, max(0.2, 0.9 * room))
        if which is None:
            continue
        met.append((NAMES[which], t))
        before = field(y, laws, *pieces)
        slope = surface_slopes(y, laws, which)
        later = -(slope[:8] @ w + np.append(np.zeros(8), slope[8:])) / (slope[:8] @ before)
        if which == 10:
            return Footstep(t, y, later, w + np.outer(before, later), met, steps)
        pieces = pieces.beyond(which, y)
        w = w + np.outer(before - field(y, laws, *pieces), later)
        h = FIRST_STEP
    raise RuntimeError("no footstep within two seconds")


def _unresolved(last: np.ndarray, stages: np.ndarray) -> float:
    """The last Legendre mode over a step, relative to 1 or the column's largest number."""
    size = np.maximum(1.0, np.max(np.abs(stages), axis=(0, 1) if stages.ndim == 3 else 0))
    return float(np.max(np.abs(np.tensordot(last, stages, 1)) / size))


def _first_crossing(
    y: np.ndarray,
    trial: np.ndarray,
    h: float,
    laws: np.ndarray,
    pieces: Pieces,
    nodes: np.ndarray,
    matrix: np.ndarray,
) -> tuple[int | None, float]:
    """The surface at which the piece ends within a step, and the step that ends there."""
    before, values = surfaces(y, laws), np.array([surfaces(each, laws) for each in trial])
    found: list[tuple[float, int]] = []
    for which, side in pieces.sides().items():
        leg = which // 5
        rates = trial[:, 6 + leg] if which < 10 else trial[:, 6]
        beyond = side * values[:, which] < 0.0
        if which < 10 and pieces.pressing[leg] == FREE:
            # A foot on its way forward passes through the ground.
            beyond &= rates < 0.0
            if beyond.any() and before[which] > 0.0:
                raise RuntimeError(f"leg {leg + 1} turns back while it is in the ground")
        elif which < 10 and rates.max() >= 0.0:
            raise RuntimeError(f"leg {leg + 1} stops while it stands")
        if beyond.any():
            found.append(
                (
                    _span(y, which, side, h * nodes[beyond.argmax()], laws, pieces, nodes, matrix),
                    which,
                )
            )
    if not found:
        return None, h
    span, which = min(found)
    return which, span


def _span(
    y: np.ndarray,
    which: int,
    side: float,
    high: float,
    laws: np.ndarray,
    pieces: Pieces,
    nodes: np.ndarray,
    matrix: np.ndarray,
) -> float:
    """The step that ends on a surface which is crossed within `high`."""

    def value(span: float) -> float:
        at, _ = collocate(y, span, laws, *pieces, nodes, matrix)
        return side * surfaces(at[-1], laws)[which]

    return float(scipy.optimize.brentq(value, 1e-6 * high, high, xtol=1e-22, rtol=1e-15))

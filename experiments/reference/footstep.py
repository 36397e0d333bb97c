"""A footstep of the compliant walker and its derivatives, by collocation on smooth pieces.

From mid-stance to mid-stance, one heel strike between: its time, its end, and their derivatives
with respect to the start and to logarithms of the walker's numbers. Every surface between pieces is
located, tangents jump there by saltation, and are carried by the equations that the collocation's
own solution satisfies. Jacobians are complex steps: exact.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.optimize

from .collocation import carry, collocate, radau
from .compliant import LAWS_AT, numbers
from .smooth_pieces import (
    FREE,
    NAMES,
    PRESSING,
    TINY,
    UPRIGHT,
    Pieces,
    band_of,
    field,
    pressed,
    surface_slopes,
    surfaces,
)

MID_STANCE = np.array([0.0, 0.399354, 0.0959, 0.0, 0.27801, -0.00053, 2.3765, -0.695])
"""Hip x, z, both angles and their rates, leg 2 standing upright (SI)."""
PARAMETERS = ("K", "c", "mu_static", "mu_kinetic")
LAWS = numbers()[[LAWS_AT[name] for name in PARAMETERS]]
"""What footsteps are differentiated with respect to unless told, and their values."""
FIRST_STEP, GROWTH = 1e-10, 2.5
"""Steps after a switch begin so small [s] that a root's singularity at touchdown is graded away."""


class Footstep(NamedTuple):
    """A footstep and its derivatives, at its end where leg 1 passes the slope's normal.

    Attributes:
        time: [s]. state: at its end, the eight numbers of the state, legs not renamed.
        time_gradient: of the time, with respect to the start (8) and the k logarithms.
        gradient: of the state at the end, (8, 8 + k).
        switches: names of the surfaces that were met, in order, with their times [s].
        peak: the largest normal force [N].
    """

    time: float
    state: np.ndarray
    time_gradient: np.ndarray
    gradient: np.ndarray
    switches: list[tuple[str, float]]
    peak: float


class _Motion(NamedTuple):
    """A step's beginning, the piece that it is on, and the method."""

    y: np.ndarray
    p: np.ndarray
    pieces: Pieces
    nodes: np.ndarray
    matrix: np.ndarray

    def stages(self, h: float) -> tuple[np.ndarray, bool]:
        return collocate(self.y, h, self.p, *self.pieces, self.nodes, self.matrix)

    def load(self, y: np.ndarray, leg: int) -> float:
        return pressed(y, leg, self.p, self.pieces.band[leg])[1]

    def growth(self, y: np.ndarray, leg: int) -> float:
        """How fast the normal force on a foot grows."""
        along = field(y, self.p, *self.pieces)
        return self.load(y + TINY * 1j * along, leg).imag / TINY

    def peak(self, end: np.ndarray, h: float) -> float:
        """The largest normal force of a step, at its end or where a foot's passes a maximum."""
        largest = 0.0
        for leg in np.flatnonzero(self.pieces.pressing == PRESSING):
            largest = max(largest, self.load(end, leg))
            low, high = (0.0, self.growth(self.y, leg)), (h, self.growth(end, leg))
            if not low[1] > 0.0 > high[1]:
                continue
            for _ in range(4):
                at = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
                place = self.stages(at)[0][-1]
                value = self.growth(place, leg)
                low, high = ((at, value), high) if value > 0.0 else (low, (at, value))
                largest = max(largest, self.load(place, leg))
        return largest


def footstep(
    start: np.ndarray = MID_STANCE,
    p: np.ndarray | None = None,
    *,
    varied: Sequence[str] = PARAMETERS,
    stages: int = 7,
    resolution: float = 1e-9,
) -> Footstep:
    """A footstep and its derivatives.

    Args:
        start: at mid-stance of leg 2.
        p: as by `numbers`; the seed's unless given.
        varied: parameters of the laws, by whose logarithms it is differentiated.
        stages: of the collocation, whose order is twice that less one.
        resolution: what its last Legendre mode may have of state and tangents.
    """
    nodes, matrix, _, last = radau(stages)
    p = numbers() if p is None else p
    places = np.array([LAWS_AT[name] for name in varied], np.int64)
    y, w = np.array(start, float), np.eye(8, 8 + len(places))
    pieces = Pieces(np.array([FREE, PRESSING]), np.array([0, band_of(y, 1, p)]))
    t, h, met, peak = 0.0, FIRST_STEP, [], 0.0
    while t < 2.0:
        motion = _Motion(y, p, pieces, nodes, matrix)
        trial, converged = motion.stages(h)
        size = _unresolved(last, trial) if converged else np.inf
        if size > resolution:
            h *= 0.5 if not converged else max(0.2, 0.9 * (resolution / size) ** (1.0 / stages))
            continue
        which, span = _first_crossing(motion, trial, h)
        if which is not None and span < h:
            trial, _ = motion.stages(span)
        moved = carry(w, trial, span, p, *pieces, matrix, places)
        rough = max(_unresolved(last, trial), _unresolved(last, moved))
        if rough > resolution:
            h = span * max(0.2, 0.9 * (resolution / rough) ** (1.0 / stages))
            continue
        y, w, t = trial[-1], moved[-1], t + span
        peak = max(peak, motion.peak(y, span))
        room = (resolution / max(rough, 1e-30)) ** (1.0 / stages)
        h = span * min(GROWTH, max(0.2, 0.9 * room))
        if which is None:
            continue
        met.append((NAMES[which], t))
        before = field(y, p, *pieces)
        slope = surface_slopes(y, p, which, places)
        later = -(slope[:8] @ w + np.append(np.zeros(8), slope[8:])) / (slope[:8] @ before)
        if which == UPRIGHT:
            return Footstep(t, y, later, w + np.outer(before, later), met, peak)
        pieces = pieces.beyond(which, y, p)
        w = w + np.outer(before - field(y, p, *pieces), later)
        h = FIRST_STEP
    raise RuntimeError("no footstep within two seconds")


def _unresolved(last: np.ndarray, stages: np.ndarray) -> float:
    """The last Legendre mode over a step, relative to 1 or the column's largest number."""
    size = np.maximum(1.0, np.max(np.abs(stages), axis=(0, 1) if stages.ndim == 3 else 0))
    return float(np.max(np.abs(np.tensordot(last, stages, 1)) / size))


def _first_crossing(motion: _Motion, trial: np.ndarray, h: float) -> tuple[int | None, float]:
    """The surface at which the piece ends within a step, and the step that ends there."""
    before = surfaces(motion.y, motion.p)
    values = np.array([surfaces(each, motion.p) for each in trial])
    found: list[tuple[float, int]] = []
    for which, side in motion.pieces.sides().items():
        leg = 0 if which == UPRIGHT else which // 5
        rates, beyond = trial[:, 6 + leg], side * values[:, which] < 0.0
        if which != UPRIGHT and motion.pieces.pressing[leg] == FREE:
            # A foot on its way forward passes through the ground.
            beyond &= rates < 0.0
            if beyond.any() and before[which] > 0.0:
                raise RuntimeError(f"leg {leg + 1} turns back while it is in the ground")
        elif which != UPRIGHT and rates.max() >= 0.0:
            raise RuntimeError(f"leg {leg + 1} stops while it stands")
        if beyond.any():
            high = h * motion.nodes[beyond.argmax()]
            found.append((_span(motion, which, side, high), which))
    if not found:
        return None, h
    span, which = min(found)
    return which, span


def _span(motion: _Motion, which: int, side: float, high: float) -> float:
    """The step that ends on a surface which is crossed within `high`."""

    def value(span: float) -> float:
        return side * surfaces(motion.stages(span)[0][-1], motion.p)[which]

    return float(scipy.optimize.brentq(value, 1e-6 * high, high, xtol=1e-22, rtol=1e-15))

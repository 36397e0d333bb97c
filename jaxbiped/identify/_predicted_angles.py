"""Predicted angles: those of the legs over the footsteps of a gait, on a measurement's clock.

A gait is periodic, so that its angles are known at any time: after each footstep the legs exchange
their parts. A model that walks faster than the data is then off by a residual, and is not refused.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.identify._measured_gait import ANGLES, MeasuredAngles

Curve = Callable[[np.ndarray], np.ndarray]
_PHASES = 64
"""Clock's zeros that are tried for each footstep of two cycles before the best is refined."""
_REFINED = 20
"""Gauss-Newton steps of a clock's zero, at most."""


class AnglesInTime(NamedTuple):
    """Leg angles of a gait between its solver's steps, by cubics, n footsteps a cycle.

    Attributes:
        splines: of both legs in each footstep, and of their rates.
        ends: when each footstep ends, since the cycle's beginning [s], shape (n,).
        mid_stance: when leg 2 passes the slope's normal in the first [s].
    """

    splines: list[list[tuple[Curve, Curve]]]
    ends: np.ndarray
    mid_stance: float

    @classmethod
    def of(cls, gait: Gait) -> "AnglesInTime":
        """Those of a gait that was found; NaN for one that was lost."""
        from scipy.interpolate import CubicHermiteSpline

        times, states = gait.orbit
        splines, lasts = [], []
        for j, clock in enumerate(np.asarray(times)):
            known = np.isfinite(clock)
            if gait.outcome is not Search.FOUND or known.sum() < 2:
                return cls([], np.full(len(times), np.nan), np.nan)
            both = []
            for name in ANGLES:
                angle, rate = (
                    np.asarray(getattr(states, each))[j][known]
                    for each in (name, name.replace("theta", "omega"))
                )
                spline = CubicHermiteSpline(clock[known], angle, rate)
                both.append((spline, spline.derivative()))
            splines.append(both)
            lasts.append(clock[known][-1])
        standing = splines[0][1][0]
        falls = [] if standing.c[-1, 0] <= 0.0 else standing.roots(extrapolate=False)
        return cls(splines, np.cumsum(lasts), float(falls[0]) if len(falls) else 0.0)

    def at(self, seen: MeasuredAngles, shift: float) -> tuple[np.ndarray, np.ndarray]:
        """The angles that were measured and their rates where the clock's zero lies at `shift`."""
        times = np.asarray(np.ma.filled(seen.times, 0.0), dtype=float) + shift
        found = [self._leg(ANGLES.index(n), times[at]) for n, at in seen.seen.items()]
        angles, rates = (np.concatenate(part) for part in zip(*found, strict=True))
        return angles, rates

    def _leg(self, leg: int, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A leg's angle and rate; its number is that of the cycle's first footstep."""
        angle, rate = np.full(times.shape, np.nan), np.full(times.shape, np.nan)
        if not np.isfinite(self.ends[-1]):
            return angle, rate
        cycles = np.floor(times / self.ends[-1])
        rest = times - cycles * self.ends[-1]
        step = np.minimum(np.searchsorted(self.ends, rest, side="right"), len(self.ends) - 1)
        begins = np.append(0.0, self.ends[:-1])
        exchanged = (cycles.astype(int) * len(self.ends) + step + leg) % 2
        for j, both in enumerate(self.splines):
            for own, (spline, slope) in enumerate(both):
                here = (step == j) & (exchanged == own)
                angle[here], rate[here] = (f(rest[here] - begins[j]) for f in (spline, slope))
        return angle, rate


def clock_zero(angles: AnglesInTime, seen: MeasuredAngles) -> float:
    """Where a measurement's clock reads zero [s]: at mid-stance, or where its angles fit best."""
    if seen.since is not None:
        return angles.mid_stance
    values, tries = seen.values, 2 * _PHASES * len(angles.ends)
    spacing = 2.0 * angles.ends[-1] / tries
    phases = spacing * np.arange(tries)
    squares = [float(np.sum((angles.at(seen, each)[0] - values) ** 2)) for each in phases]
    best = phases[int(np.argmin(squares))]
    shift = best
    for _ in range(_REFINED):
        own, rates = angles.at(seen, shift)
        move = float(rates @ (values - own) / (rates @ rates))
        shift = float(np.clip(shift + move, best - spacing, best + spacing))
        if abs(move) < 1e-13:
            break
    return shift

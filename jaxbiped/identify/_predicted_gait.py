"""Predicted gait: what a scene's gait would show of what was measured, and its derivatives.

A gait is periodic, so that its angles are known at any time: after each footstep the legs exchange
their parts. A model that walks faster than the data is then off by a residual, and is not refused.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import as_float
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.identify._measured_gait import ANGLES, MeasuredAngles, MeasuredGait
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import RigidScene, Scene

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


AnyScene: TypeAlias = Scene | RigidScene
_DIFFERENCE = 3e-3
"""Relative change of a parameter for the derivatives of angles over time."""


class Prediction(NamedTuple):
    """Of n numbers and k parameters.

    Attributes:
        values: shape (n,).
        slopes: derivatives with respect to the parameters in units of their sizes, shape (n, k).
        slope_errors: their estimated errors.
        state: of the gait on the section; `state_slopes` its derivatives, leaves of shape (k,).
        found: whether there is a gait.
    """

    values: np.ndarray
    slopes: np.ndarray
    slope_errors: np.ndarray
    state: PyTree
    state_slopes: PyTree
    found: bool

    def state_at(self, moved: np.ndarray) -> PyTree:
        """The state where parameters are so many sizes further, to first order."""
        return jtu.tree_map(
            lambda leaf, slope: as_float(np.asarray(leaf) + float(slope @ moved)),
            self.state,
            self.state_slopes,
        )


def predict(
    scene: AnyScene,
    measured: MeasuredGait,
    parameters: dict[str, float],
    sizes: np.ndarray,
    guess: PyTree | None,
    *,
    accuracy: str,
    engine: str,
) -> Prediction:
    """The gait of a scene under these parameters, as far as it was measured.

    Args:
        scene: the walker.
        measured: what is wanted, and under which conditions.
        parameters: values of the k parameters by name.
        sizes: by how much each moves, shape (k,).
        guess: a state near the gait; None to search it.
        accuracy, engine: as for `find_gait`.
    """
    names = tuple(parameters)

    def gait_at(values: dict[str, float], guess: PyTree | None, wanted: tuple[str, ...]) -> Gait:
        own = with_parameters(scene, {**values, **measured.conditions})
        return find_gait(
            jtu.tree_map(as_float, own),
            guess,
            footsteps=measured.footsteps,
            parameters=wanted,
            accuracy=accuracy,
            radius_sensitivities=False,
            engine=engine,
        )

    gait = gait_at(parameters, guess, names)
    found = gait.outcome is Search.FOUND and bool(gait.sound)
    values, slopes, errors = (
        np.array([np.asarray(getattr(part, name)) for name in measured.measures])
        for part in (gait.measures, gait.sensitivities, gait.sensitivity_errors)
    )
    slopes, errors = (part.reshape(-1, len(names)) * sizes for part in (slopes, errors))
    if measured.angles is not None and found:
        along, along_errors, at = _angles_along(gait_at, gait, measured, parameters, sizes)
        values = np.append(values, at)
        slopes = np.concatenate([slopes, along])
        errors = np.concatenate([errors, along_errors])
    state = gait.measures.state
    state_slopes = jtu.tree_map(lambda leaf: np.asarray(leaf) * sizes, gait.sensitivities.state)
    return Prediction(values, slopes, errors, state, state_slopes, found)


def _angles_along(
    gait_at: Callable[[dict[str, float], PyTree, tuple[str, ...]], Gait],
    gait: Gait,
    measured: MeasuredGait,
    parameters: dict[str, float],
    sizes: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of the measured angles, these' errors, and the angles.

    Derivatives are central differences, one-sided where one of the two gaits is lost, with infinite
    errors where both are; errors are otherwise what the second differences make of them. A clock
    that is fitted along is projected out (variable projection: Golub and Pereyra 1973, as Kaufman
    1975 shortens it).
    """
    seen = measured.angles
    assert seen is not None
    here = AnglesInTime.of(gait)
    shift = clock_zero(here, seen)
    own, rates = here.at(seen, shift)
    slopes, errors = [], []
    for k, (name, size) in enumerate(zip(parameters, sizes, strict=True)):
        ends = []
        for sign in (1.0, -1.0):
            moved = np.zeros(len(sizes))
            moved[k] = sign * _DIFFERENCE
            ahead = jtu.tree_map(np.asarray, gait.sensitivities.state)
            near = jtu.tree_map(
                lambda leaf, slope, moved=moved: as_float(leaf + float(slope @ (sizes * moved))),
                gait.measures.state,
                ahead,
            )
            values = parameters | {name: parameters[name] + sign * _DIFFERENCE * size}
            there = AnglesInTime.of(gait_at(values, near, ()))
            ends.append(there.at(seen, shift if measured.clocks else there.mid_stance)[0])
        lost = [not np.all(np.isfinite(each)) for each in ends]
        up, down = (own if gone else each for each, gone in zip(ends, lost, strict=True))
        width = _DIFFERENCE * (2 - sum(lost))
        slopes.append((up - down) / width if width else np.zeros_like(own))
        errors.append(np.abs(up - 2.0 * own + down) / width if width else np.full_like(own, np.inf))
    along = np.stack(slopes, axis=-1)
    if measured.clocks:
        along -= np.outer(rates, rates @ along) / (rates @ rates)
    return along, np.stack(errors, axis=-1), own

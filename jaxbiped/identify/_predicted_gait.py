"""Predicted gait: what a scene's gait would show of what was measured, and its derivatives.

A gait is periodic, so that its angles are known at any time: after each footstep of a mirrored
walker the legs exchange their parts. A model that walks faster than the data is then off by a
residual, and is not refused.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._types import Scalar, as_float, rows_of
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._equivalent_states import exchange_legs
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait, Measures
from jaxbiped.hybrid._sections import AbstractSection, MidStance
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.identify._measured_gait import OF_STATE, MeasuredAngles, MeasuredGait
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import AbstractMinimalScene

Curve = Callable[[np.ndarray], np.ndarray]
Curves: TypeAlias = dict[str, tuple[Curve, Curve]]
"""Angles over time by their names in states, each with its rate."""
_PHASES = 64
"""Clock's zeros that are tried for each part of two cycles before the best is refined."""
_REFINED = 20
"""Gauss-Newton steps of a clock's zero, at most."""


class AnglesInTime(NamedTuple):
    """Angles of bodies in a gait between its solver's steps, by cubics, in the n parts of a cycle.

    Each part ends by an arrival at the section, where the sides of a mirror are exchanged.

    Attributes:
        splines: of each part those of all angles and of their rates, by name: as the part has them,
            and with the sides exchanged.
        ends: when each part ends, since the cycle's beginning [s], shape (n,).
        mid_stance: when the stance leg comes to mid-stance in the first [s].
    """

    splines: list[tuple[Curves, Curves]]
    ends: np.ndarray
    mid_stance: float

    @classmethod
    def of(cls, scene: Any, gait: Gait) -> "AnglesInTime":
        """Those of a gait that was found; NaN for one that was lost."""
        times, states = gait.orbit
        splines, lasts = [], []
        for j, clock in enumerate(np.asarray(times)):
            known = np.isfinite(clock)
            if gait.outcome is not Search.FOUND or known.sum() < 2:
                return cls([], np.full(len(times), np.nan), np.nan)
            part = jtu.tree_map(lambda leaf, j=j, known=known: np.asarray(leaf)[j][known], states)
            exchanged = jtu.tree_map(np.asarray, exchange_legs(scene, part))
            splines.append((_curves(clock[known], part), _curves(clock[known], exchanged)))
            lasts.append(clock[known][-1])
        return cls(splines, np.cumsum(lasts), _mid_stance(scene, gait))

    def at(self, seen: MeasuredAngles, shift: npt.ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """The angles that were measured and their rates where the clock's zero lies at `shift`.

        They are along the last axis, beside those of the shift.
        """
        clock = np.asarray(np.ma.filled(seen.times, 0.0), dtype=float)
        times = clock + np.asarray(shift)[..., None]
        found = [self._angle(name, times[..., at]) for name, at in seen.seen.items()]
        angles, rates = (np.concatenate(part, axis=-1) for part in zip(*found, strict=True))
        return angles, rates

    def _angle(self, name: str, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """An angle and its rate; its name is that of the cycle's first part."""
        angle, rate = np.full(times.shape, np.nan), np.full(times.shape, np.nan)
        if not np.isfinite(self.ends[-1]):
            return angle, rate
        cycles = np.floor(times / self.ends[-1])
        rest = times - cycles * self.ends[-1]
        part = np.minimum(np.searchsorted(self.ends, rest, side="right"), len(self.ends) - 1)
        begins = np.append(0.0, self.ends[:-1])
        exchanged = (cycles.astype(int) * len(self.ends) + part) % 2
        for j, both in enumerate(self.splines):
            for side, curves in enumerate(both):
                here = (part == j) & (exchanged == side)
                angle[here], rate[here] = (f(rest[here] - begins[j]) for f in curves[name])
        return angle, rate


def _curves(times: np.ndarray, states: PyTree) -> Curves:
    """Cubics through all angles of states with leaves (n,), and their derivatives."""
    from scipy.interpolate import CubicHermiteSpline

    found = {}
    for name in states._fields:
        if name.startswith("theta_"):
            rate = getattr(states, name.replace("theta_", "omega_", 1))
            spline = CubicHermiteSpline(times, getattr(states, name), rate)
            found[name] = (spline, spline.derivative())
    return found


def _mid_stance(scene: AbstractMinimalScene, gait: Gait) -> float:
    """When the stance leg comes to mid-stance in a gait's first part [s]."""
    from scipy.interpolate import CubicHermiteSpline

    if not system_of(scene).footsteps_end_on_section:
        return 0.0  # cycles begin between the ends of footsteps, at mid-stance
    clock = np.asarray(gait.orbit[0])[0]
    known = np.isfinite(clock)
    states = rows_of(gait.orbit[1], 0)
    past = (np.asarray(each)[known] for each in _past_mid_stance(scene, states))
    rises = CubicHermiteSpline(clock[known], *past).roots(extrapolate=False)
    return float(rises[0]) if len(rises) else 0.0


@cached_jit
def _past_mid_stance(scene: AbstractMinimalScene, states: PyTree) -> tuple[Scalar, Scalar]:
    """A function of states that rises through zero at mid-stance, and its rate."""
    rates = system_of(scene).vector_field(0.0, states, scene)
    return jax.jvp(lambda y: MidStance().value(scene, y), (states,), (rates,))


def clock_zero(angles: AnglesInTime, seen: MeasuredAngles) -> float:
    """Where a measurement's clock reads zero [s]: at mid-stance, or where its angles fit best."""
    if seen.since is not None:
        return angles.mid_stance
    values, tries = seen.values, 2 * _PHASES * len(angles.ends)
    spacing = 2.0 * angles.ends[-1] / tries
    phases = spacing * np.arange(tries)
    squares = np.sum((angles.at(seen, phases)[0] - values) ** 2, axis=-1)
    shift = best = phases[int(np.argmin(squares))]
    for _ in range(_REFINED):
        own, rates = angles.at(seen, shift)
        move = float(rates @ (values - own) / (rates @ rates))
        shift = float(np.clip(shift + move, best - spacing, best + spacing))
        if abs(move) < 1e-13:
            break
    return shift


_DIFFERENCE = 3e-3
"""Relative change of a parameter for the derivatives of angles over time."""


def _measure(measures: Measures, name: str) -> PyTree:
    """A measure by name, or a coordinate of the state on the section."""
    if name.startswith(OF_STATE):
        return getattr(measures.state, name.removeprefix(OF_STATE))
    return getattr(measures, name)


class Prediction(NamedTuple):
    """Of n numbers and k parameters.

    Attributes:
        values: shape (n,).
        slopes: derivatives with respect to the parameters in units of their sizes, shape (n, k).
        slope_errors: their estimated errors.
        state: of the gait on the section; `state_slopes` its derivatives, leaves of shape (k,).
        found: whether there is a gait whose derivatives are known.
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
    scene: AbstractMinimalScene,
    measured: MeasuredGait,
    parameters: dict[str, float],
    sizes: np.ndarray,
    guess: PyTree | None,
    *,
    accuracy: str,
    engine: str,
    section: AbstractSection | None = None,
) -> Prediction:
    """The gait of a scene under these parameters, as far as it was measured.

    `sizes` (k,) tell by how much each parameter moves; `guess` is a state near the gait, or None to
    search it.
    """
    names = tuple(parameters)

    def scene_at(values: dict[str, float]) -> AbstractMinimalScene:
        return with_parameters(scene, {**values, **measured.conditions})

    def gait_at(values: dict[str, float], guess: PyTree | None, wanted: tuple[str, ...]) -> Gait:
        return find_gait(
            scene_at(values),
            guess,
            footsteps=measured.footsteps,
            section=section,
            parameters=wanted,
            accuracy=accuracy,
            radius_sensitivities=False,
            engine=engine,
        )

    gait = gait_at(parameters, guess, names)
    found = gait.outcome is Search.FOUND and bool(gait.sound)
    values, slopes, errors = (
        np.array([np.asarray(_measure(part, name)) for name in measured.measures])
        for part in (gait.measures, gait.sensitivities, gait.sensitivity_errors)
    )
    slopes, errors = (part.reshape(-1, len(names)) * sizes for part in (slopes, errors))
    found = found and bool(np.all(np.isfinite(slopes)))
    state_slopes = jtu.tree_map(lambda leaf: np.asarray(leaf) * sizes, gait.sensitivities.state)
    told = Prediction(values, slopes, errors, gait.measures.state, state_slopes, found)
    if measured.angles is None or not found:
        return told

    def angles_near(values: dict[str, float], moved: np.ndarray) -> AnglesInTime:
        return AnglesInTime.of(scene_at(values), gait_at(values, told.state_at(moved), ()))

    here = AnglesInTime.of(scene_at(parameters), gait)
    angles = _angles_along(here, angles_near, measured, parameters, sizes)
    parts = zip((values, slopes, errors), angles, strict=True)
    values, slopes, errors = map(np.concatenate, parts)
    return told._replace(values=values, slopes=slopes, slope_errors=errors)


def _angles_along(
    here: AnglesInTime,
    angles_near: Callable[[dict[str, float], np.ndarray], AnglesInTime],
    measured: MeasuredGait,
    parameters: dict[str, float],
    sizes: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The measured angles, their derivatives, and these' errors.

    Derivatives are central differences, one-sided where one of the two gaits is lost, with infinite
    errors where both are; errors are otherwise what the second differences make of them. A clock
    that is fitted along is projected out (variable projection: Golub and Pereyra 1973, as Kaufman
    1975 shortens it).
    """
    seen = measured.angles
    assert seen is not None
    shift = clock_zero(here, seen)
    own, rates = here.at(seen, shift)
    slopes, errors = [], []
    for k, (name, size) in enumerate(zip(parameters, sizes, strict=True)):
        ends = []
        for sign in (1.0, -1.0):
            moved = np.zeros(len(sizes))
            moved[k] = sign * _DIFFERENCE
            values = parameters | {name: parameters[name] + sign * _DIFFERENCE * size}
            there = angles_near(values, moved)
            ends.append(there.at(seen, shift if measured.clocks else there.mid_stance)[0])
        lost = [not np.all(np.isfinite(each)) for each in ends]
        up, down = (own if gone else each for each, gone in zip(ends, lost, strict=True))
        width = _DIFFERENCE * (2 - sum(lost))
        slopes.append((up - down) / width if width else np.zeros_like(own))
        errors.append(np.abs(up - 2.0 * own + down) / width if width else np.full_like(own, np.inf))
    along = np.stack(slopes, axis=-1)
    if measured.clocks:
        along -= np.outer(rates, rates @ along) / (rates @ rates)
    return own, along, np.stack(errors, axis=-1)

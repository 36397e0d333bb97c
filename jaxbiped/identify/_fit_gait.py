"""Identification of a scene's parameters from measured gaits."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_finite,
    check_type,
    warn,
)
from jaxbiped._progress import Stage, stage
from jaxbiped.dynamics._state import cyclic_names, recurring_names, zero_state
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._return_map_spec import arrivals_of
from jaxbiped.gait._search_starts import default_guess, state_of_guess
from jaxbiped.hybrid._hybrid_system import MINIMAL_SCENES
from jaxbiped.hybrid._sections import AbstractSection, section_of
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.identify._gait_fit import FitEnding, GaitFit, information
from jaxbiped.identify._interval_end import AT_LIMIT, interval_end, linear_step
from jaxbiped.identify._measured_gait import OF_STATE, MeasuredGait
from jaxbiped.identify._predicted_gait import Prediction, predict
from jaxbiped.scene._parameter_access import (
    parameter_names,
    parameter_quantities,
    parameter_values,
    with_parameters,
)
from jaxbiped.scene._scene import AbstractMinimalScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import GAIT_ACCURACIES

_WITHIN = 1.959963984540054
"""Standard errors to each end of a 95 % interval."""
_LINEAR = 0.02
"""Standard error of every parameter, in units of its size, up to which a model counts as linear."""
UNLIKELY = 1e-3
"""Probability of chi squared below which a fit is said not to fit."""
_GAIN = 1e-4
"""Change of the residuals, squared, as a share of their mean square, at which a descent ends."""
_STARTS, _ABOUT = 8, float(np.log(3.0))
"""Starts that are tried beside a fit's own, and how far from it."""
_FITS = 3
"""Descents, at most: a better fit that an interval's end comes upon begins another."""

Tried: TypeAlias = tuple[float, np.ndarray, list[Prediction]]
"""Sum of squares, variables and predictions."""


def fit_gait(
    scene: AbstractMinimalScene,
    vary: Sequence[str] | Mapping[str, tuple[float, float]],
    measured: MeasuredGait | Sequence[MeasuredGait],
    *,
    guess: Gait | WalkerState | PyTree | None = None,
    section: AbstractSection | None = None,
    accuracy: str = "balanced",
    engine: str = "auto",
    max_evaluations: int = 50,
    progress: bool | None = None,
) -> GaitFit:
    """Finds the parameters with which a scene's gaits match measured ones.

    Weighted least squares over the logarithms of the parameters, or over themselves between bounds
    that hold 0, by SciPy's trust-region method (Branch, Coleman and Li 1999). Each gait is searched
    from the state of the one before; the derivatives, with their error bars, are those of
    `find_gait`. Measurement errors are assumed to be independent and normal. The covariance is that
    of the linearised fit of all parameters, (Jᵀ J)⁻¹. Intervals are profile intervals; if a
    standard error exceeds 2 % of its parameter, the ends are found with further scenes.

    Args:
        scene: the walker or hybrid system, with the parameters at which the fit begins.
        vary: names of the parameters to fit (see `parameter_names`), or their bounds by name (SI).
        measured: one measured gait or several, under known conditions.
        guess: a gait, or a state near the gait at which the fit begins; None to search for it (a
            hybrid system needs one).
        section: section on which cycles begin. Default: as of `find_gait`.
        accuracy, engine: as for `find_gait`.
        max_evaluations: maximum number of scenes that a descent tries.
        progress: whether to show on stderr what is being done, how far it is and what was found; by
            default (None) after two seconds, in a terminal, a notebook or a command.

    Returns:
        Estimates with standard errors, and the names of parameters that the data do not determine
        or that are at their bounds. An interrupt ends the fit early, with the best estimates so
        far. A `RuntimeWarning` is issued if the model does not fit: if chi squared would be so
        large in fewer than 1 of 1,000 cases.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.ladder()["rigid"]
        >>> period = float(jb.find_gait(scene, parameters=()).measures.period)
        >>> seen = jb.identify.MeasuredGait({"period": (period, 1e-4)})
        >>> fit = jb.fit_gait(jb.with_parameters(scene, {"J": 0.01}), ("J",), seen)
        >>> str(fit.ending), round(fit.estimates["J"], 4)
        ('converged', 0.0096)
    """
    scene = check_scene(scene, *MINIMAL_SCENES)
    section = section_of(scene, section)
    bounds = _check_bounds(scene, vary)
    gaits = list(measured) if isinstance(measured, Sequence) else [measured]
    if not gaits:
        raise ArgumentError("measured = [] is not allowed: give one gait at least.")
    for each in gaits:
        _check_measured(scene, each, bounds)
    near = state_of_guess(scene, guess)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    check_count("max_evaluations", max_evaluations)
    with stage("fitting", unit="scenes", show=progress) as now:
        descent = Descent(scene, bounds, gaits, accuracy, engine, now, near, section)
        fit = descent.run(int(max_evaluations))
    if fit.ending is FitEnding.CONVERGED and fit.p_value < UNLIKELY:
        warn(
            f"the model does not fit the data: chi squared is {fit.chi_squared:.3g} at "
            f"{fit.freedom} degrees of freedom (p = {fit.p_value:.1g}), so that standard errors "
            "and intervals mean nothing.",
        )
    return fit


def _check_bounds(
    scene: AbstractMinimalScene, vary: Sequence[str] | Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Bounds by name; without any, those between which the parameter keeps its sign."""
    check_type("vary", vary, Sequence, Mapping)
    if isinstance(vary, str) or not len(vary):
        raise ArgumentError(f"vary = {vary!r} is not allowed: name the parameters to fit.")
    own, bounds = parameter_values(scene), {}
    for name in vary:
        check_choice("vary", name, parameter_names(scene))
        value = float(own[name])
        pair = (0.0, math.inf) if value > 0.0 else (-math.inf, 0.0)
        if value == 0.0 and not isinstance(vary, Mapping):
            raise ArgumentError(
                f"vary = {name!r} is not allowed, because the scene's own {name} is 0 and "
                "gives no scale: give bounds, or begin with another value."
            )
        if isinstance(vary, Mapping):
            pair = vary[name]
            if np.shape(pair) != (2,) or not pair[0] < pair[1]:
                raise ArgumentError(
                    f"vary[{name!r}] = {pair!r} is not allowed: give the lower and the upper bound."
                )
            check_finite(f"vary[{name!r}]", pair)
            if not pair[0] <= value <= pair[1]:
                raise ArgumentError(
                    f"vary[{name!r}] = {pair!r} does not hold the scene's own {name} = {value:g}, "
                    "where the fit begins."
                )
            for bound in pair if pair[0] * pair[1] <= 0.0 else ():
                with_parameters(scene, {name: bound})
        bounds[name] = (float(pair[0]), float(pair[1]))
    return bounds


def _check_measured(
    scene: AbstractMinimalScene, measured: MeasuredGait, bounds: Mapping[str, object]
) -> None:
    check_type("measured", measured, MeasuredGait)
    for name in measured.conditions:
        if name in bounds:
            raise ArgumentError(f"{name} is both known (conditions) and to be fitted (vary).")
    with_parameters(scene, measured.conditions)
    arrivals_of(scene, measured.footsteps)
    kind = scene.state_type
    lacks = [] if system_of(scene).load_exists(scene, zero_state(scene)) else ["peak_normal"]
    lacks += [] if scene.posture else ["angles"]
    lacks += [] if cyclic_names(kind) else ["step_length", "speed"]
    given = [*measured.measures, *(["angles"] if measured.angles is not None else [])]
    for name in given:
        if name in lacks:
            raise ArgumentError(f"{name} is not allowed: a {type(scene).__name__} has none.")
        if name.startswith(OF_STATE):
            check_choice("measures", name, [OF_STATE + each for each in recurring_names(kind)])
    for name in () if measured.angles is None else measured.angles.known:
        angles = [each for each in scene.state_type._fields if each.startswith("theta_")]
        check_choice("an angle", name, angles)


class Descent:
    """A fit under way. Variables are log(p/p₀), or p − p₀ over the width of bounds that hold 0."""

    def __init__(
        self,
        scene: AbstractMinimalScene,
        bounds: dict[str, tuple[float, float]],
        measured: list[MeasuredGait],
        accuracy: str,
        engine: str,
        now: Stage,
        guess: PyTree | None = None,
        section: AbstractSection | None = None,
    ) -> None:
        """`guess` is a state near the gait of the scene's own parameters; None to search it."""
        own = parameter_values(scene)
        self.scene, self.measured, self.now, self.guess = scene, measured, now, guess
        self.units = {name: each.unit for name, each in parameter_quantities(scene).items()}
        self.names, self.first = tuple(bounds), np.array([float(own[name]) for name in bounds])
        limits = np.array(list(bounds.values())).T
        self.linear = np.isfinite(limits).all(axis=0) & (limits[0] <= 0.0) & (limits[1] >= 0.0)
        self.widths = np.where(self.linear, limits[1] - limits[0], 1.0)
        self.limits = np.sort([self.variables(ends) for ends in limits], axis=0)
        self.how: dict[str, Any] = dict(accuracy=accuracy, engine=engine, section=section)
        self.values = np.concatenate([gait.values for gait in measured])
        self.deviations = np.concatenate([gait.deviations for gait in measured])
        self.tried: list[Tried] = []
        self.last: tuple[np.ndarray, list[Prediction] | None] | None = None
        self.evaluations, self.searching = 0, True

    def run(self, most: int) -> GaitFit:
        """Minimises; tells what was found.

        If the start has no gait, or ends where the model does not fit, others about it are tried.
        """
        fit: GaitFit | None = None
        try:
            fit = self.fit_from(np.zeros(len(self.names)), most)
            if fit.ending is FitEnding.NO_GAIT or fit.p_value < UNLIKELY:
                for begin in self.others():
                    self.tried = [begin]
                    other = self.fit_from(begin[1], most)
                    fit = fit if fit.chi_squared <= other.chi_squared else other
                    if not fit.p_value < UNLIKELY:
                        break
        except KeyboardInterrupt:
            now = self.summary(FitEnding.INTERRUPTED)
            if fit is None or now.chi_squared < fit.chi_squared:
                fit = now
            fit = dataclasses.replace(fit, ending=FitEnding.INTERRUPTED)
        return dataclasses.replace(fit, evaluations=self.evaluations)

    def fit_from(self, begin: np.ndarray, most: int) -> GaitFit:
        """The fit from a start on; a better one that an interval comes upon is gone on from."""
        if self.predictions(begin) is None:
            return self.summary(FitEnding.NO_GAIT)
        for _ in range(_FITS):
            ending = self.minimise(begin, most)
            best = self.best
            fit = self.summary(ending)
            if self.best is best or ending is not FitEnding.CONVERGED:
                break
            begin = self.best[1]
        return fit

    @property
    def best(self) -> Tried:
        """The best of the scenes that were tried and have their gaits."""
        return min(self.tried, key=lambda each: each[0])

    def others(self) -> list[Tried]:
        """Starts within a factor of three, or within the bounds, the best first.

        Their gaits are searched from nothing: the first start may have led to others.
        """
        from scipy.stats import qmc

        low, high = np.clip(self.limits, -_ABOUT, _ABOUT)
        found: list[Tried] = []
        self.searching = True
        for start in qmc.scale(qmc.Sobol(len(low), seed=0).random(_STARTS), low, high):
            self.tried = []
            self.predictions(start)
            found += self.tried
        return sorted(found, key=lambda each: each[0])

    def minimise(self, begin: np.ndarray, most: int) -> FitEnding:
        from scipy.optimize import least_squares

        self.searching = True
        found = least_squares(
            self.residuals,
            begin,
            self.slopes,
            bounds=tuple(self.limits),
            max_nfev=most,
            xtol=1e-9,
            ftol=1e-12,
            gtol=1e-10,
        )
        return FitEnding.CONVERGED if found.success else FitEnding.OUT_OF_EVALUATIONS

    def parameters(self, at: np.ndarray) -> dict[str, float]:
        by_factor = self.first * np.exp(np.where(self.linear, 0.0, at))
        values = np.where(self.linear, self.first + at * self.widths, by_factor)
        return dict(zip(self.names, values.tolist(), strict=True))

    def variables(self, values: np.ndarray) -> np.ndarray:
        moved = (values - self.first) / self.widths
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.linear, moved, np.log(values / self.first))

    def sizes(self, at: np.ndarray) -> np.ndarray:
        """Derivatives of the parameters with respect to the variables."""
        values = np.array(list(self.parameters(at).values()))
        return np.where(self.linear, self.widths, values)

    def predictions(self, at: np.ndarray) -> list[Prediction] | None:
        """Of every measured gait; None where one is lost."""
        if self.last is not None and np.array_equal(self.last[0], at):
            return self.last[1]
        parts: list[Prediction] = []
        for k, each in enumerate(self.measured):
            one = self._predict(at, each, k)
            if one is None or not one.found:
                break
            parts.append(one)
        found = parts if len(parts) == len(self.measured) else None
        self.evaluations += 1
        self.last = (at.copy(), found)
        if found is not None:
            square = float(np.sum(self._scaled_misfits(found) ** 2))
            self.tried.append((square, at.copy(), found))
        best = f"chi squared {self.best[0]:.4g}" if self.tried else "no gait yet"
        self.now.update(found=best)
        return found

    def _predict(self, at: np.ndarray, each: MeasuredGait, k: int) -> Prediction | None:
        guess = self.guess
        if self.tried:
            _, nearest, found = min(self.tried, key=lambda each: float(np.sum((each[1] - at) ** 2)))
            guess = found[k].state_at(at - nearest)
        values, sizes = self.parameters(at), self.sizes(at)
        try:
            with_parameters(self.scene, values)
        except ArgumentError:
            return None  # such as static friction below kinetic
        one = predict(self.scene, each, values, sizes, guess, **self.how)
        may_search = self.searching and guess is not None
        if not one.found and may_search and default_guess(self.scene) is not None:
            one = predict(self.scene, each, values, sizes, None, **self.how)
        return one

    def residuals(self, at: np.ndarray) -> np.ndarray:
        """In standard deviations; infinite where a gait is lost, which shortens the step."""
        found = self.predictions(at)
        return np.full(len(self.values), np.inf) if found is None else self._scaled_misfits(found)

    def slopes(self, at: np.ndarray) -> np.ndarray:
        """Of the residuals; none, which ends a descent, where no step of about 1 moves them."""
        found = self.predictions(at)
        assert found is not None  # no step ends without its gaits
        slopes, off = self._scaled_slopes(found)[0], self._scaled_misfits(found)
        free = slopes[:, ~self._at_bounds(at, off, slopes)]
        moved = free @ np.linalg.solve(free.T @ free + np.eye(free.shape[1]), free.T @ off)
        return slopes * (np.sum(moved**2) > _GAIN * np.mean(off**2))

    def _scaled_misfits(self, found: list[Prediction]) -> np.ndarray:
        predicted = np.concatenate([each.values for each in found])
        return (predicted - self.values) / self.deviations

    def _scaled_slopes(self, found: list[Prediction]) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the misfits, and their errors."""
        slopes, errors = zip(*((each.slopes, each.slope_errors) for each in found), strict=True)
        by = self.deviations[:, None]
        return np.concatenate(slopes) / by, np.concatenate(errors) / by

    def summary(self, ending: FitEnding) -> GaitFit:
        """The fit as far as it came."""
        k, names = len(self.names), np.array(self.names)
        at, found = np.zeros(k), None
        if self.tried:
            _, at, found = best = self.best
        covariance, undetermined = np.full((k, k), np.nan), np.ones(k, bool)
        held, residuals, freedom = np.zeros(k, bool), np.full(len(self.values), np.nan), 0
        ends = np.full((2, k), np.nan)
        if found is not None:
            slopes, errors = self._scaled_slopes(found)
            residuals = self._scaled_misfits(found)
            told = information(slopes, errors)
            held = self._at_bounds(at, residuals, slopes) & told.resolved
            free = information(slopes[:, ~held], errors[:, ~held])
            undetermined[held], undetermined[~held] = False, free.undetermined
            covariance[np.ix_(~held, ~held)] = free.covariance
            freedom = len(self.values) - free.rank - sum(each.clocks for each in self.measured)
            widest = np.nanmax(np.diag(told.covariance), initial=0.0)
            wide = bool(told.undetermined.any() or widest > _LINEAR**2)
            follow = wide and ending is FitEnding.CONVERGED
            self.searching = False  # a profile follows gaits from one to the next
            for which in np.flatnonzero(~held & (follow | ~undetermined)).tolist():
                ends[:, which] = self._interval(best, which, follow)
        ends = np.where(np.isclose(ends, self.limits, 0.0, AT_LIMIT), [[-np.inf], [np.inf]], ends)
        known = np.isfinite(ends)
        undetermined, lost = ~known.any(axis=0) & ~held, ~known.all(axis=0)
        covariance[lost] = covariance[:, lost] = np.nan
        ends[:, undetermined] = np.nan
        spread = np.sqrt(np.diag(covariance))
        errors = spread * self.sizes(at)  # negative where a parameter is
        low, high = (self.parameters(end) for end in np.clip(ends, *self.limits))
        return GaitFit(
            ending=ending,
            estimates=self.parameters(at),
            standard_errors=dict(zip(self.names, np.abs(errors).tolist(), strict=True)),
            intervals={n: (min(low[n], high[n]), max(low[n], high[n])) for n in self.names},
            correlation=covariance / np.outer(spread, spread) * np.sign(np.outer(errors, errors)),
            undetermined=tuple(names[undetermined].tolist()),
            at_bounds=tuple(names[held].tolist()),
            one_sided=tuple(names[lost & ~undetermined & ~held].tolist()),
            residuals=residuals,
            freedom=freedom,
            evaluations=self.evaluations,
            units={name: self.units[name] for name in self.names},
        )

    def _at_bounds(self, at: np.ndarray, residuals: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Which parameters lie at a bound, within a thousandth of their error, and push there."""
        low, high = self.limits
        near = 1e-3 / np.maximum(np.linalg.norm(slopes, axis=0), 1.0)
        push = -slopes.T @ residuals
        return ((at - low <= near) & (push < 0.0)) | ((high - at <= near) & (push > 0.0))

    def _model(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Residuals and derivatives at variables; None where a gait is lost."""
        found = self.predictions(at)
        return None if found is None else self._linearised(found)

    def _linearised(self, found: list[Prediction]) -> tuple[np.ndarray, np.ndarray]:
        """Residuals and those of their derivatives that exceed their own errors."""
        slopes, errors = self._scaled_slopes(found)
        return self._scaled_misfits(found), slopes * information(slopes, errors).resolved

    def _interval(self, best: Tried, which: int, follow: bool) -> tuple[float, float]:
        """Both ends in the variable; by the linearised model, or followed where it bends.

        They are followed from the outermost scene tried that lies within and tells of it: the way
        to it from the best one may lead over scenes where derivatives tell nothing.
        """
        limits, square = self.limits, best[0] + _WITHIN**2
        within = [each for each in self.tried if each[0] < square]
        known = [information(*self._scaled_slopes(each[2])) for each in within]
        telling = [a for a, b in zip(within, known, strict=True) if follow and b.distinct[which]]

        def end(sign: float) -> float:
            if follow and not telling:
                return sign * np.inf
            _, at, found = max(telling, key=lambda e: sign * e[1][which], default=best)
            here = self._linearised(found)
            if not follow:
                step, *_ = linear_step(*here, square, which, sign, limits - at)
                return float(at[which] + step[which])
            end = sign * interval_end(self._model, at, here, square, which, sign, limits)
            return sign * max(end, *(sign * float(each[1][which]) for each in within))

        return end(-1.0), end(1.0)

"""Identification of a scene's parameters from measured gaits."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import PyTree
from tqdm import tqdm

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_finite, check_type
from jaxbiped.identify._gait_fit import FitEnding, GaitFit, information
from jaxbiped.identify._measured_gait import MeasuredGait
from jaxbiped.identify._predicted_gait import AnyScene, Prediction, predict
from jaxbiped.scene._check_scene import check_scene
from jaxbiped.scene._parameters import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._accuracy import GAIT_ACCURACIES

_WITHIN = 1.959963984540054
"""Standard errors to each end of a 95 % interval."""


def fit_gait(
    scene: AnyScene,
    vary: Sequence[str] | Mapping[str, tuple[float, float]],
    measured: MeasuredGait | Sequence[MeasuredGait],
    *,
    accuracy: str = "balanced",
    engine: str = "auto",
    max_evaluations: int = 50,
    progress: bool = False,
) -> GaitFit:
    """Finds the parameters under which a scene's gaits are those that were measured.

    Weighted least squares by a trust-region method (Branch, Coleman and Li 1999, as SciPy has it)
    over the logarithms of the parameters; gaits are found from their predecessors' states, and
    their derivatives are those of `find_gait`, certified by error bars. Errors are taken as
    independent and normal. Covariance is that of the linearised fit, (Jᵀ J)⁻¹.

    Args:
        scene: the walker, where the fit begins.
        vary: names of the parameters to fit (see `parameter_names`), or their bounds by name (SI).
        measured: one gait or several, under conditions that are known.
        accuracy, engine: as for `find_gait`.
        max_evaluations: scenes tried, at most.
        progress: whether to show a bar on stderr.

    Returns:
        Estimates with standard errors, and which parameters the data do not tell. An interrupt
        ends the fit early with the best estimates so far.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.ladder()["rigid"]
        >>> period = float(jb.find_gait(scene, parameters=()).measures.period)
        >>> seen = jb.identify.MeasuredGait({"period": (period, 1e-4)})
        >>> fit = jb.fit_gait(jb.with_parameters(scene, {"J": 0.01}), ("J",), seen)
        >>> str(fit.ending), round(fit.estimates["J"], 4)
        ('converged', 0.0096)
    """
    scene = check_scene(scene, Scene, RigidScene)
    bounds = _check_bounds(scene, vary)
    gaits = list(measured) if isinstance(measured, Sequence) else [measured]
    if not gaits:
        raise ArgumentError("measured = [] is not allowed: give one gait at least.")
    for each in gaits:
        _check_measured(scene, each, bounds)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    check_count("max_evaluations", max_evaluations)
    bar = tqdm(total=max_evaluations, unit="scenes", disable=not progress)
    with bar:
        return _Fit(scene, bounds, gaits, accuracy, engine, bar).run(int(max_evaluations))


class _Fit:
    """A fit under way. Variables are log(p/p₀), or where p₀ is 0 a share of the bounds' width."""

    def __init__(
        self,
        scene: AnyScene,
        bounds: dict[str, tuple[float, float]],
        measured: list[MeasuredGait],
        accuracy: str,
        engine: str,
        bar: tqdm,
    ) -> None:
        own = parameter_values(scene)
        self.scene, self.measured, self.bar = scene, measured, bar
        self.names, self.first = tuple(bounds), np.array([float(own[name]) for name in bounds])
        self.limits = np.array(list(bounds.values())).T
        self.widths = np.where(self.first == 0.0, self.limits[1] - self.limits[0], 1.0)
        self.how = dict(accuracy=accuracy, engine=engine)
        self.values = np.concatenate([gait.values for gait in measured])
        self.deviations = np.concatenate([gait.deviations for gait in measured])
        self.best: tuple[float, np.ndarray, list[Prediction]] | None = None
        self.last: tuple[np.ndarray, list[Prediction] | None] | None = None
        self.evaluations = 0

    def run(self, most: int) -> GaitFit:
        """Minimises; tells what was found."""
        from scipy.optimize import least_squares

        begin = np.zeros(len(self.names))
        if self.predictions(begin) is None:
            return self.described(FitEnding.NO_GAIT)
        ending = FitEnding.INTERRUPTED
        try:
            found = least_squares(
                self.residuals,
                begin,
                self.slopes,
                bounds=tuple(map(self.variables, self.limits)),
                max_nfev=most,
                xtol=1e-9,
                ftol=1e-12,
                gtol=1e-10,
            )
            ending = FitEnding.CONVERGED if found.success else FitEnding.OUT_OF_EVALUATIONS
        except KeyboardInterrupt:
            pass
        return self.described(ending)

    def parameters(self, at: np.ndarray) -> dict[str, float]:
        """The parameters' values at these variables."""
        values = np.where(self.first == 0.0, at * self.widths, self.first * np.exp(at))
        return dict(zip(self.names, values.tolist(), strict=True))

    def variables(self, values: np.ndarray) -> np.ndarray:
        """The variables at these values."""
        zero = self.first == 0.0
        ratios = np.where(zero, 1.0, values) / np.where(zero, 1.0, self.first)
        with np.errstate(divide="ignore"):
            return np.where(zero, values / self.widths, np.log(ratios))

    def sizes(self, at: np.ndarray) -> np.ndarray:
        """Derivatives of the parameters with respect to the variables."""
        values = np.array(list(self.parameters(at).values()))
        return np.where(self.first == 0.0, self.widths, values)

    def predictions(self, at: np.ndarray) -> list[Prediction] | None:
        """Of every measured gait; None where one is lost."""
        if self.last is not None and np.array_equal(self.last[0], at):
            return self.last[1]
        found: list[Prediction] | None = []
        for k, each in enumerate(self.measured):
            one = self._predict(at, each, k)
            if one is None or not one.found:
                found = None
                break
            assert found is not None
            found.append(one)
        self.evaluations += 1
        self.bar.update()
        self.last = (at.copy(), found)
        if found is not None:
            square = float(np.sum(self._weighted(found) ** 2))
            if self.best is None or square < self.best[0]:
                self.best = (square, at.copy(), found)
        return found

    def _predict(self, at: np.ndarray, each: MeasuredGait, k: int) -> Prediction | None:
        guess: PyTree | None = None
        if self.best is not None:
            guess = self.best[2][k].state_at(at - self.best[1])
        values, sizes = self.parameters(at), self.sizes(at)
        try:
            with_parameters(self.scene, values)
        except ArgumentError:
            return None  # such as static friction below kinetic
        one = predict(self.scene, each, values, sizes, guess, **self.how)
        if not one.found and guess is not None:
            one = predict(self.scene, each, values, sizes, None, **self.how)
        return one

    def residuals(self, at: np.ndarray) -> np.ndarray:
        """In standard deviations; infinite where a gait is lost, which shortens the step."""
        found = self.predictions(at)
        return np.full(len(self.values), np.inf) if found is None else self._weighted(found)

    def slopes(self, at: np.ndarray) -> np.ndarray:
        """Derivatives of the residuals."""
        found = self.predictions(at)
        assert found is not None  # no step ends without its gaits
        return np.concatenate([each.slopes for each in found]) / self.deviations[:, None]

    def _weighted(self, found: list[Prediction]) -> np.ndarray:
        predicted = np.concatenate([each.values for each in found])
        return (predicted - self.values) / self.deviations

    def described(self, ending: FitEnding) -> GaitFit:
        """The fit as far as it came."""
        k = len(self.names)
        at, found = np.zeros(k), None
        if self.best is not None:
            _, at, found = self.best
        estimates, sizes = self.parameters(at), self.sizes(at)
        covariance, undetermined = np.full((k, k), np.nan), np.ones(k, bool)
        residuals = np.full(len(self.values), np.nan)
        if found is not None:
            slopes, errors = (
                np.concatenate([getattr(each, part) for each in found]) / self.deviations[:, None]
                for part in ("slopes", "slope_errors")
            )
            covariance, undetermined = information(slopes, errors)
            residuals = self._weighted(found)
        spread = np.sqrt(np.diag(covariance))
        ends = [at - _WITHIN * spread, at + _WITHIN * spread]
        low, high = (self.parameters(end) for end in ends)
        return GaitFit(
            ending=ending,
            estimates=estimates,
            standard_errors=dict(zip(self.names, (spread * sizes).tolist(), strict=True)),
            intervals={
                name: (min(low[name], high[name]), max(low[name], high[name]))
                if math.isfinite(low[name])
                else (math.nan, math.nan)
                for name in self.names
            },
            correlation=covariance / np.outer(spread, spread),
            undetermined=tuple(n for n, lost in zip(self.names, undetermined, strict=True) if lost),
            residuals=residuals,
            evaluations=self.evaluations,
        )


def _check_bounds(
    scene: AnyScene, vary: Sequence[str] | Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Bounds by name; without any, those between which the parameter keeps its sign."""
    if isinstance(vary, str) or not len(vary):
        raise ArgumentError(f"vary = {vary!r} is not allowed: name the parameters to fit.")
    own, bounds = parameter_values(scene), {}
    for name in vary:
        check_choice("vary", name, parameter_names(scene))
        value = float(own[name])
        pair = (0.0, math.inf) if value > 0.0 else (-math.inf, 0.0)
        if value == 0.0 and not isinstance(vary, Mapping):
            raise ArgumentError(
                f"vary = {name!r} is not allowed where the scene's own {name} is 0, which tells no "
                "size: give bounds, or begin with another value."
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
            if value != 0.0 and pair[0] * pair[1] <= 0.0:
                raise ArgumentError(
                    f"vary[{name!r}] = {pair!r} is not allowed: bounds must have the sign of the "
                    f"scene's own {name} = {value:g}."
                )
        bounds[name] = (float(pair[0]), float(pair[1]))
    return bounds


def _check_measured(scene: AnyScene, measured: MeasuredGait, bounds: Mapping[str, object]) -> None:
    check_type("measured", measured, MeasuredGait)
    for name in measured.conditions:
        if name in bounds:
            raise ArgumentError(f"{name} is both known (conditions) and to be fitted (vary).")
    with_parameters(scene, measured.conditions)

"""Identification of a scene's parameters from measured gaits."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_finite,
    check_type,
    warn,
)
from jaxbiped._progress import stage
from jaxbiped.dynamics._state import state_type
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._return_map_spec import arrivals_of
from jaxbiped.gait._search_starts import state_of_guess
from jaxbiped.identify._descent import UNLIKELY, Descent
from jaxbiped.identify._gait_fit import FitEnding, GaitFit
from jaxbiped.identify._measured_gait import MeasuredGait
from jaxbiped.identify._predicted_gait import AnyScene
from jaxbiped.scene._parameter_access import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import GAIT_ACCURACIES


def fit_gait(
    scene: AnyScene,
    vary: Sequence[str] | Mapping[str, tuple[float, float]],
    measured: MeasuredGait | Sequence[MeasuredGait],
    *,
    guess: Gait | WalkerState | None = None,
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
        scene: the walker, with the parameters at which the fit begins.
        vary: names of the parameters to fit (see `parameter_names`), or their bounds by name (SI).
        measured: one measured gait or several, under known conditions.
        guess: a gait, or a state near the gait at which the fit begins; None to search for it.
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
    scene = check_scene(scene, Scene, RigidScene)
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
        descent = Descent(scene, bounds, gaits, accuracy, engine, now, near)
        fit = descent.run(int(max_evaluations))
    if fit.ending is FitEnding.CONVERGED and fit.p_value < UNLIKELY:
        warn(
            f"the model does not fit the data: chi squared is {fit.chi_squared:.3g} at "
            f"{fit.freedom} degrees of freedom (p = {fit.p_value:.1g}), so that standard errors "
            "and intervals mean nothing.",
        )
    return fit


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


def _check_measured(scene: AnyScene, measured: MeasuredGait, bounds: Mapping[str, object]) -> None:
    check_type("measured", measured, MeasuredGait)
    for name in measured.conditions:
        if name in bounds:
            raise ArgumentError(f"{name} is both known (conditions) and to be fitted (vary).")
    with_parameters(scene, measured.conditions)
    arrivals_of(scene, measured.footsteps)
    for name in () if measured.angles is None else measured.angles.known:
        angles = [each for each in state_type(scene)._fields if each.startswith("theta_")]
        check_choice("an angle", name, angles)

"""`jaxbiped fit`: find the parameters under which gaits are those that were measured."""

import math

from jaxbiped._types import JsonObject
from jaxbiped.cli._report import Report, table
from jaxbiped.cli.commands._fit import Fit
from jaxbiped.identify._fit_gait import fit_gait
from jaxbiped.identify._gait_fit import FitEnding, GaitFit
from jaxbiped.identify._measured_gait import read_measured
from jaxbiped.scene._parameter_access import parameter_quantities
from jaxbiped.scene._scene import RedundantScene


def run(options: Fit) -> int:
    """Runs the command; returns the exit code."""
    scene = options.scene.scene()
    assert not isinstance(scene, RedundantScene)
    measured = read_measured(options.file)
    names = tuple(name.strip() for name in options.vary.split(",") if name.strip())
    fit = fit_gait(
        scene,
        names,
        measured,
        accuracy=options.accuracy,
        engine=options.engine,
        max_evaluations=options.max_evaluations,
        progress=True,
    )
    report = Report(options.json)
    units = {name: quantity.unit for name, quantity in parameter_quantities(scene).items()}
    rows = [
        (name, units[name], _number(fit.estimates[name]), *map(_number, _errors(fit, name)))
        for name in names
    ]
    head = ("parameter", "unit", "estimate", "standard error", "95 % from", "to")
    report.say(table(head, rows, most=64))
    report.say(
        f"{fit.ending} after {fit.evaluations} scenes; chi squared {fit.chi_squared:.3g} at "
        f"{fit.freedom} degrees of freedom (p = {fit.p_value:.2g})"
    )
    if fit.undetermined:
        report.say(f"these data do not tell {', '.join(fit.undetermined)}")
    if fit.at_bounds:
        report.say(f"held by a bound: {', '.join(fit.at_bounds)}")
    report.finish(fit_numbers(fit))
    return 0 if fit.ending is FitEnding.CONVERGED else 1


def fit_numbers(fit: GaitFit) -> JsonObject:
    """A fit in SI units, ready for JSON: None for what is not known."""

    def known(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "ending": str(fit.ending),
        "estimates": fit.estimates,
        "standard_errors": {name: known(each) for name, each in fit.standard_errors.items()},
        "intervals_95": {
            name: [known(end) for end in pair] for name, pair in fit.intervals.items()
        },
        "correlation": [[known(float(each)) for each in row] for row in fit.correlation],
        "undetermined": list(fit.undetermined),
        "at_bounds": list(fit.at_bounds),
        "residuals": [known(float(each)) for each in fit.residuals],
        "chi_squared": known(fit.chi_squared),
        "freedom": fit.freedom,
        "p_value": known(fit.p_value),
        "evaluations": fit.evaluations,
    }


def _errors(fit: GaitFit, name: str) -> tuple[float, float, float]:
    return fit.standard_errors[name], *fit.intervals[name]


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "unknown"

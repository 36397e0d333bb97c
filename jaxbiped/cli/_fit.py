"""`jaxbiped fit`: find the parameters under which gaits are those that were measured."""

import dataclasses
import math
from pathlib import Path

from tyro.conf import Positional

from jaxbiped._checks import ArgumentError, check_writable_file
from jaxbiped._types import JsonObject
from jaxbiped.cli._option_fields import Engine, GaitAccuracy, Group, group
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._walk_options import SceneOptions
from jaxbiped.identify._fit_gait import fit_gait
from jaxbiped.identify._gait_fit import FitEnding, GaitFit
from jaxbiped.identify._measured_file import read_measured
from jaxbiped.scene._parameters import parameter_quantities
from jaxbiped.scene._redundant_scene import RedundantScene


@dataclasses.dataclass(frozen=True)
class Fit:
    """Fit parameters to measured gaits; print estimates, their errors and what data cannot tell."""

    file: Positional[Path]
    """JSON file of measured gaits (see jaxbiped.identify.read_measured)."""
    vary: str
    """Names of the parameters to fit, with commas between: K,c,mu_kinetic."""
    scene: Group[SceneOptions] = group(SceneOptions)
    accuracy: GaitAccuracy = "balanced"
    engine: Engine = "auto"
    max_evaluations: int = 50
    """Scenes tried, at most."""
    json: Path | None = None
    """File for the numbers as JSON; - prints only that."""

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        scene = self.scene.scene()
        if isinstance(scene, RedundantScene):
            raise ArgumentError(
                'formulation = "redundant" is not allowed here: it must be "minimal".'
            )
        if self.json is not None and str(self.json) != "-":
            check_writable_file("json", self.json)
        measured = read_measured(self.file)
        names = tuple(name.strip() for name in self.vary.split(",") if name.strip())
        fit = fit_gait(
            scene,
            names,
            measured,
            accuracy=self.accuracy,
            engine=self.engine,
            max_evaluations=self.max_evaluations,
            progress=True,
        )
        report = Report(self.json)
        units = {name: quantity.unit for name, quantity in parameter_quantities(scene).items()}
        rows = [
            (name, units[name], _number(fit.estimates[name]), *map(_number, _errors(fit, name)))
            for name in names
        ]
        head = ("parameter", "unit", "estimate", "standard error", "95 % from", "to")
        report.say(table(head, rows, most=64))
        report.say(
            f"{fit.ending} after {fit.evaluations} scenes; chi squared {fit.chi_squared:.3g} at "
            f"{fit.freedom} degrees of freedom"
        )
        if fit.undetermined:
            report.say(f"these data do not tell {', '.join(fit.undetermined)}")
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
        "residuals": [known(float(each)) for each in fit.residuals],
        "chi_squared": known(fit.chi_squared),
        "freedom": fit.freedom,
        "evaluations": fit.evaluations,
    }


def _errors(fit: GaitFit, name: str) -> tuple[float, float, float]:
    return fit.standard_errors[name], *fit.intervals[name]


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "unknown"

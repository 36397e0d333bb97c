"""`jaxbiped fit`: find the parameters under which gaits are those that were measured."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

import jaxbiped as jb
from jaxbiped._files import read_json, read_text
from jaxbiped.cli import _options as options
from jaxbiped.cli._report import Report, columns
from jaxbiped.cli._scene_options import SceneOptions, minimal

_ESTIMATE = {
    "parameter": "{0[0]}",
    "unit": "{0[1].unit}",
    "estimate": "{0[2]:.6g}",
    "standard error": "{0[3]:.6g}",
    "95 % from": "{0[4][0]:.6g}",
    "to": "{0[4][1]:.6g}",
}
_REDUNDANT = 'formulation = "redundant" is not allowed here: it must be "minimal".'


_IS_MEASURED = options.Check(
    lambda name, path: (read_text if path.suffix.lower() == ".csv" else read_json)(name, path)
)


class Fit(options.Command, of=("fit_gait",)):
    """Fit parameters to measured gaits; print estimates, errors and undetermined parameters."""

    file: Annotated[Positional[Path], _IS_MEASURED]
    """File of measured gaits, CSV or JSON (see jaxbiped.identify.read_measured)."""
    vary: str
    """Names of the parameters to fit, separated by commas: K,c,mu_kinetic."""
    scene: Annotated[SceneOptions, minimal(_REDUNDANT)]
    accuracy: options.GaitAccuracy
    engine: options.Engine
    max_evaluations: options.Count
    output: options.OutputOptions

    def run(self) -> int:
        scene = self.scene.scene()
        assert not isinstance(scene, jb.RedundantScene)
        self.output.make_folder()
        names = tuple(name.strip() for name in self.vary.split(",") if name.strip())
        measured, how = jb.identify.read_measured(self.file, scene), self.arguments("fit_gait")
        fit = jb.fit_gait(scene, names, measured, **how)
        report = Report(self.output.json, self.output.csv)
        units = jb.parameter_quantities(scene)
        parts = (units, fit.estimates, fit.standard_errors, fit.intervals)
        report.say(columns(_ESTIMATE, [(name, *(part[name] for part in parts)) for name in names]))
        report.say(
            f"{fit.ending} after {fit.evaluations} scenes; chi squared {fit.chi_squared:.3g} at "
            f"{fit.freedom} degrees of freedom (p = {fit.p_value:.2g})"
        )
        if fit.undetermined:
            report.say(f"these data do not determine {', '.join(fit.undetermined)}")
        if fit.one_sided:
            report.say(f"limited on one side only: {', '.join(fit.one_sided)}")
        if fit.at_bounds:
            report.say(f"held by a bound: {', '.join(fit.at_bounds)}")
        report.wrote(self.output.draw({"fit": lambda: jb.plot.fit(fit)}))
        numbers = vars(fit) | {"ending": str(fit.ending)}
        numbers["intervals_95"] = numbers.pop("intervals")
        report.finish(
            numbers | {"chi_squared": fit.chi_squared, "p_value": fit.p_value}, fit.to_csv
        )
        return 0 if fit.ending is jb.identify.FitEnding.CONVERGED else 1

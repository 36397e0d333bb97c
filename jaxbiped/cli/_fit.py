"""`jaxbiped fit`: parameters of measured gaits, with errors."""

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
_REDUNDANT_FIT = 'formulation = "redundant" is not allowed here: it must be "minimal".'
_IS_MEASURED = options.Check(
    lambda name, path: (read_text if path.suffix.lower() == ".csv" else read_json)(name, path)
)


class Fit(options.Command, of=("fit_gait",)):
    """Fit parameters to measured gaits; print estimates, errors and undetermined parameters."""

    file: Annotated[Positional[Path], _IS_MEASURED]
    """File of measured gaits, CSV or JSON (see jaxbiped.identify.read_measured)."""
    vary: str
    """Names of the parameters to fit, separated by commas: K,c,mu_kinetic."""
    scene: Annotated[SceneOptions, minimal(_REDUNDANT_FIT)]
    accuracy: options.GaitAccuracy
    engine: options.Engine
    max_evaluations: options.Count
    output: options.OutputOptions

    def check_names(self, scene: SceneOptions) -> None:
        """Raises `ArgumentError` for parameters that the scene lacks."""
        for name in self.names:
            scene.check_parameter("vary", name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters to fit."""
        return tuple(name.strip() for name in self.vary.split(",") if name.strip())

    def run(self) -> int:
        scene = self.scene.scene()
        assert not isinstance(scene, jb.RedundantScene)
        self.output.make_folder()
        measured, how = jb.identify.read_measured(self.file, scene), self.arguments("fit_gait")
        fit = jb.fit_gait(scene, self.names, measured, **how)
        report = Report(self.output.json, self.output.csv)
        parts = (jb.parameter_quantities(scene), fit.estimates, fit.standard_errors, fit.intervals)
        report.say(
            columns(_ESTIMATE, [(name, *(part[name] for part in parts)) for name in self.names])
        )
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
        numbers = vars(fit) | {"ending": str(fit.ending), "intervals_95": fit.intervals}
        del numbers["intervals"]
        also = {"chi_squared": fit.chi_squared, "p_value": fit.p_value}
        report.finish(numbers | also, fit.to_csv)
        report.wrote(self.output.draw({"fit": lambda: jb.plot.fit(fit)}))
        if fit.ending is jb.identify.FitEnding.INTERRUPTED:
            raise options.interrupted("the best estimates so far are what is reported")
        return 0 if fit.ending is jb.identify.FitEnding.CONVERGED else 1

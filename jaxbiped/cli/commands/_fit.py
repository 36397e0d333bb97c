"""`jaxbiped fit`: find the parameters under which gaits are those that were measured."""

import dataclasses
from pathlib import Path

from tyro.conf import Positional

from jaxbiped._checks import ArgumentError, check_count
from jaxbiped._files import read_json
from jaxbiped.cli._option_checks import check_engine, check_gait_accuracy
from jaxbiped.cli._option_fields import Engine, GaitAccuracy, Group, group
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions


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

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        self.scene.check()
        if self.scene.formulation == "redundant":
            raise ArgumentError(
                'formulation = "redundant" is not allowed here: it must be "minimal".'
            )
        check_gait_accuracy(self.accuracy)
        check_engine(self.engine)
        check_count("max_evaluations", self.max_evaluations)
        OutputOptions(json=self.json).check()
        read_json("file", self.file)

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._fit import run

        return run(self)

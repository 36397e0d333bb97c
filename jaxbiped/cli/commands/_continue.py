"""`jaxbiped continue`: follow the periodic gait along a parameter and print its bifurcations."""

import dataclasses
from typing import Annotated

from tyro.conf import arg

from jaxbiped._checks import check_count, check_finite, check_positive
from jaxbiped.cli._option_checks import check_engine, check_gait_accuracy
from jaxbiped.cli._option_fields import Engine, GaitAccuracy, Group, group
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions, StartOptions


@dataclasses.dataclass(frozen=True)
class ContinueGait:
    """Follow the periodic gait along a parameter; print its stability and its bifurcations."""

    scene: Group[SceneOptions] = group(SceneOptions)
    start: Group[StartOptions] = group(StartOptions)
    output: Group[OutputOptions] = group(OutputOptions)
    along: str = "slope"
    """The parameter, by its name."""
    first: Annotated[float, arg(name="from")] = 0.005
    """Beginning of its range (SI units)."""
    last: Annotated[float, arg(name="to")] = 0.1
    """End of its range."""
    footsteps: int = 1
    """Footsteps in a cycle."""
    log: bool | None = None
    """Whether equal steps are equal factors; unless said, where the range spans two decades."""
    largest_step: float = 0.02
    """Largest arclength of a step, in which the range counts 1."""
    max_points: int = 200
    """Points followed in each direction at most."""
    accuracy: GaitAccuracy = "balanced"
    engine: Engine = "auto"

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        self.scene.check()
        self.start.check()
        check_finite("from", self.first)
        check_finite("to", self.last)
        check_count("footsteps", self.footsteps)
        check_positive("largest_step", self.largest_step)
        check_count("max_points", self.max_points)
        check_gait_accuracy(self.accuracy)
        check_engine(self.engine)
        OutputOptions(json=self.output.json).check()

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._continue import run

        return run(self)

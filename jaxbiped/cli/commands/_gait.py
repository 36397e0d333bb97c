"""`jaxbiped gait`: find the periodic gait and print its stability and sensitivities."""

import dataclasses

from jaxbiped._checks import check_choice, check_count
from jaxbiped.cli._choices import SECTIONS
from jaxbiped.cli._option_checks import check_accuracy, check_engine
from jaxbiped.cli._option_fields import Engine, Group, group
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions, StartOptions


@dataclasses.dataclass(frozen=True)
class FindGait:
    """Find the periodic gait near a start; print its multipliers and its elasticities."""

    scene: Group[SceneOptions] = group(SceneOptions)
    start: Group[StartOptions] = group(StartOptions)
    output: Group[OutputOptions] = group(OutputOptions)
    accuracy: str = "balanced"
    """How accurately to solve: draft, balanced or tight; or a relative error, such as 1e-4."""
    footsteps: int = 1
    """Footsteps in a cycle."""
    section: str | None = None
    """Where a cycle begins: mid-stance (the usual one) or heel-strike (a rigid walker's)."""
    engine: Engine = "auto"

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        self.scene.check()
        self.start.check()
        check_accuracy(self.accuracy)
        check_count("footsteps", self.footsteps)
        if self.section is not None:
            check_choice("section", self.section, SECTIONS)
        check_engine(self.engine)
        OutputOptions(json=self.output.json).check()

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._gait import run

        return run(self)

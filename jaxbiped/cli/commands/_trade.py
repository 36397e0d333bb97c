"""`jaxbiped trade`: what accuracy costs for a scene, by our own ways of solving."""

import dataclasses
from pathlib import Path

from jaxbiped._checks import ArgumentError, check_count, check_positive
from jaxbiped.cli._option_fields import Group, group
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions, StartOptions


@dataclasses.dataclass(frozen=True)
class Trade:
    """Measure what each accuracy costs for a scene: errors of a walk and of the gait, by our own
    methods, engines and tolerances, each beside its steps and its time."""

    scene: Group[SceneOptions] = group(SceneOptions)
    start: Group[StartOptions] = group(StartOptions)
    duration: float = 2.0
    """Simulated time of the walk [s]."""
    repeats: int = 3
    """Warm runs of which the median counts."""
    full: bool = False
    """Every solver, both engines and a ladder of tolerances; takes many minutes."""
    out: Path | None = None
    """Folder for the pictures."""
    json: Path | None = None
    """File for the numbers; - prints only them."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        self.scene.check()
        if self.scene.model != "compliant" or self.scene.formulation != "minimal":
            raise ArgumentError(
                "model or formulation is not allowed here: compliant and minimal are measured."
            )
        self.start.check()
        check_positive("duration", self.duration, "s")
        check_count("repeats", self.repeats)
        OutputOptions(json=self.json).check()

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._trade import run

        return run(self)

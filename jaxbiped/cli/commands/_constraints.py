"""`jaxbiped constraints`: the constraint methods compared on the seed's walk."""

import dataclasses
from pathlib import Path

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_positive
from jaxbiped.cli._choices import CONSTRAINT_METHODS
from jaxbiped.cli._integrator import Integrator
from jaxbiped.cli._option_fields import Group, group
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions, StartOptions


@dataclasses.dataclass(frozen=True)
class Constraints:
    """Compare the seven ways to hold the hip together: violation, error against the minimal
    formulation, and time."""

    scene: Group[SceneOptions] = group(SceneOptions)
    start: Group[StartOptions] = group(StartOptions)
    methods: tuple[str, ...] = CONSTRAINT_METHODS
    """Names of the methods to compare."""
    integrators: tuple[str, ...] = ("rodas4:1e-6", "euler:dt=1e-6", "runge2:dt=1e-6")
    """Each SOLVER:TOLERANCE, or SOLVER:dt=STEP for steps of one size [s]."""
    duration: float = 0.5
    """Simulated time [s]."""
    repeats: int = 3
    """Runs of which the fastest counts; none is repeated once they took a second."""
    out: Path | None = None
    """Folder for the picture."""
    json: Path | None = None
    """File for the numbers in SI units; - prints only them."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        self.scene.check()
        if self.scene.model != "compliant" or self.scene.formulation != "minimal":
            raise ArgumentError(
                "model or formulation is not allowed here: compliant and minimal are compared."
            )
        self.start.check()
        for name in self.methods:
            check_choice("methods", name, CONSTRAINT_METHODS)
        for text in self.integrators:
            Integrator.read(text)
        check_positive("duration", self.duration, "s")
        check_count("repeats", self.repeats)
        OutputOptions(json=self.json).check()

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._constraints import run

        return run(self)

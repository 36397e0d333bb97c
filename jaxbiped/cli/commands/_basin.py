"""`jaxbiped basin`: what becomes of many starts."""

import dataclasses

from jaxbiped._checks import ArgumentError
from jaxbiped.cli._basin_options import StartsOptions, SweepOptions
from jaxbiped.cli._option_fields import Group, group
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions


@dataclasses.dataclass(frozen=True)
class Basin:
    """Label many starts: which walk on and in which gait, and how the others end."""

    scene: Group[SceneOptions] = group(SceneOptions)
    starts: Group[StartsOptions] = group(StartsOptions)
    sweep: Group[SweepOptions] = group(SweepOptions)
    output: Group[OutputOptions] = group(OutputOptions)

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        self.scene.check()
        if self.scene.formulation == "redundant":
            raise ArgumentError(
                'formulation = "redundant" is not allowed for a basin: starts are labelled in '
                "minimal coordinates."
            )
        self.starts.check()
        self.sweep.check()
        OutputOptions(json=self.output.json).check()

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._basin import run

        return run(self)

"""`jaxbiped walk`: simulate the seed's walker and print its footsteps."""

import dataclasses

from jaxbiped.cli._option_fields import Group, group
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions, SolveOptions, StartOptions


@dataclasses.dataclass(frozen=True)
class Walk:
    """Simulate the seed's walker from a start; print its footsteps and how it ended."""

    scene: Group[SceneOptions] = group(SceneOptions)
    start: Group[StartOptions] = group(StartOptions)
    solve: Group[SolveOptions] = group(SolveOptions)
    output: Group[OutputOptions] = group(OutputOptions)

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        self.scene.check()
        self.start.check()
        self.solve.check()
        OutputOptions(json=self.output.json).check()

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._walk import run

        return run(self)

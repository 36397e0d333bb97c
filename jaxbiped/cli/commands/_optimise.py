"""`jaxbiped optimise`: the parameters within bounds whose gait is best, and what certifies it."""

import dataclasses
from pathlib import Path

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_not_negative
from jaxbiped.cli._choices import OPTIMISERS
from jaxbiped.cli._option_checks import check_engine, check_gait_accuracy
from jaxbiped.cli._option_fields import Engine, GaitAccuracy, Group, group
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions


@dataclasses.dataclass(frozen=True)
class Optimise:
    """Find the parameters within bounds whose periodic gait is best, and certify it."""

    vary: str
    """Parameters that vary, d,r,J (half to double their values) or with bounds d=0.05:0.2,r,J."""
    scene: Group[SceneOptions] = group(SceneOptions)
    maximise: str | None = None
    """Measure of the gait to maximise, such as speed."""
    minimise: str | None = None
    """Or to minimise, such as spectral_radius."""
    subject_to: tuple[str, ...] = ()
    """What must hold, such as "spectral_radius<0.4" "step_length>0.2"."""
    optimiser: str = "trust-region"
    """trust-region, slsqp, trust-constr, or without requirements optax."""
    iterations: int = 200
    """Most iterations of a run."""
    restarts: int = 0
    """Further runs, from the best of scattered designs."""
    seed: int = 0
    """Seed of these designs."""
    accuracy: GaitAccuracy = "balanced"
    engine: Engine = "auto"
    basin: int = 1024
    """Starts about the gait that are labelled for the certificate's basin; 0 for none."""
    footsteps: int = 200
    """Footsteps of the certificate's walk from a pushed start; 0 for none."""
    bifurcations: str = "slope"
    """Parameters in which the certificate seeks the nearest bifurcation: slope,d; or none."""
    fatal_push: bool = False
    """Whether the certificate seeks the smallest push after which the gait is left."""
    other_engine: bool = False
    """Whether the certificate also finds the gait by the other engine (compiles for minutes)."""
    store: Path | None = None
    """File that keeps every evaluation; the same command goes on from it."""
    json: Path | None = None
    """File for the numbers in SI units; - prints only them."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        self.scene.check()
        if self.scene.formulation == "redundant":
            raise ArgumentError(
                "formulation = redundant is not allowed here: how the hip is held makes no "
                "difference to a gait; choose minimal."
            )
        check_choice("optimiser", self.optimiser, OPTIMISERS)
        check_count("iterations", self.iterations)
        for name in ("restarts", "basin", "footsteps"):
            check_not_negative(name, getattr(self, name))
        check_gait_accuracy(self.accuracy)
        check_engine(self.engine)
        OutputOptions(json=self.json).check()

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._optimise import run

        return run(self)

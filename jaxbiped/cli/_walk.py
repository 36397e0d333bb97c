"""`jaxbiped walk`: simulate the seed's walker and print its footsteps."""

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from tyro.conf import OmitArgPrefixes

from jaxbiped import _clock
from jaxbiped.cli._held import constraint_numbers, constraint_sentence
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._rigid_walk import run_rigid_walk
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions, SolveOptions, StartOptions
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.dynamics._state import State
from jaxbiped.gait._footsteps import Footsteps, footsteps
from jaxbiped.gait._ledger import energy_ledger
from jaxbiped.scene._redundant_scene import RedundantScene
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.simulate._simulate import Simulation
from jaxbiped.solve._ending import Ending
from jaxbiped.solve._trajectory import Trajectory

_SOLVER_STEPS = 65536
"""Cap on the solver's steps for ten simulated seconds, raised in proportion for more."""
_MOST_ROWS = 24


@dataclasses.dataclass(frozen=True)
class Walk:
    """Simulate the seed's walker from a start; print its footsteps and how it ended."""

    scene: Annotated[SceneOptions, OmitArgPrefixes] = dataclasses.field(
        default_factory=SceneOptions
    )
    start: Annotated[StartOptions, OmitArgPrefixes] = dataclasses.field(
        default_factory=StartOptions
    )
    solve: Annotated[SolveOptions, OmitArgPrefixes] = dataclasses.field(
        default_factory=SolveOptions
    )
    output: Annotated[OutputOptions, OmitArgPrefixes] = dataclasses.field(
        default_factory=OutputOptions
    )

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        imported = time.perf_counter()
        scene = self.scene.scene()
        state = self.start.state(scene)
        if isinstance(scene, RigidScene):
            assert isinstance(state, RigidState)
            return run_rigid_walk(scene, state, self.solve, self.output)
        assert isinstance(state, State)
        request = Simulation.prepare(
            scene,
            state,
            duration=self.solve.duration,
            solver=self.solve.solver,
            rtol=self.solve.rtol,
            atol=self.solve.atol,
            engine=self.solve.engine,
            max_solver_steps=int(_SOLVER_STEPS * max(1.0, self.solve.duration / 10.0)),
        )
        self.output.check()
        prepared = time.perf_counter()
        program = request.compile()
        compiled = time.perf_counter()
        trajectory = program()
        finished = time.perf_counter()
        wall = {
            "import": imported - _clock.IMPORT_BEGAN,
            "compile": compiled - prepared,
            "run": finished - compiled,
        }
        self._report(scene, trajectory, wall)
        return 1 if trajectory.outcome == Ending.SOLVER_FAILED else 0

    def _report(self, scene: Any, trajectory: Trajectory, wall: dict[str, float]) -> None:
        steps = footsteps(scene, trajectory)
        ledger = energy_ledger(scene, trajectory)
        numbers: dict[str, Any] = {
            "ending": str(trajectory.outcome),
            "slope_rad": float(scene.ground.slope),
            "duration_s": float(trajectory.t[-1]),
            "steps": _step_list(steps),
            "energy_residual_J": float(ledger.residual[0]),
            "gravity_work_J": float(ledger.gravity_work[0]),
            "solver": {
                "name": self.solve.solver,
                "rtol": self.solve.rtol,
                "engine": trajectory.engine,
                "accepted": int(trajectory.accepted),
                "rejected": int(trajectory.rejected),
            },
            "wall_s": wall,
        }
        report = Report(self.output.json)
        if isinstance(scene, RedundantScene):
            numbers["constraints"] = constraint_numbers(scene, trajectory)
        _print(report, numbers)
        if isinstance(scene, RedundantScene):
            report.say(constraint_sentence(numbers["constraints"]))
        if self.output.out is not None:
            for path in write_outputs(scene, trajectory, self.output.out):
                report.say(f"wrote {path}")
        report.finish(numbers)


def write_outputs(scene: Any, trajectory: Trajectory, out: Path) -> list[Path]:
    """Writes the figures, the animation and the trajectory; returns their paths."""
    from jaxbiped import plot
    from jaxbiped.gait._dataset import trajectory_dataset

    figures: dict[str, Callable[..., Any]] = {
        "strobe.png": plot.gait_strobe,
        "phase_portrait.png": plot.phase_portrait,
        "leg_angles.png": plot.leg_angles,
        "penetrations.png": plot.penetrations,
        "contact_forces.png": plot.contact_forces,
    }
    # The numbers first: no picture that fails takes them away.
    trajectory_dataset(scene, trajectory).to_netcdf(out / "trajectory.nc")
    for name, draw in figures.items():
        draw(scene, trajectory).savefig(out / name)
    plot.save_animation(plot.animate(scene, trajectory), out / "walk.gif")
    return [out / "trajectory.nc", *(out / name for name in figures), out / "walk.gif"]


def _step_list(steps: Footsteps) -> list[dict[str, float]]:
    names = (
        "time_s",
        "period_s",
        "length_m",
        "speed_m_s",
        "peak_normal_N",
        "max_penetration_m",
        "double_support_s",
    )
    columns = [np.asarray(getattr(steps, name)) for name in names]
    return [dict(zip(names, map(float, row), strict=True)) for row in zip(*columns, strict=True)]


def _print(report: Report, numbers: dict[str, Any]) -> None:
    rows = [
        (
            str(k + 1),
            f"{row['time_s']:.4f}",
            f"{row['period_s']:.4f}",
            f"{row['length_m']:.4f}",
            f"{row['speed_m_s']:.4f}",
            f"{row['peak_normal_N']:.1f}",
            f"{1e3 * row['max_penetration_m']:.3f}",
            f"{1e3 * row['double_support_s']:.3f}",
        )
        for k, row in enumerate(numbers["steps"])
    ]
    head = (
        "step",
        "time s",
        "period s",
        "length m",
        "speed m/s",
        "peak N",
        "depth mm",
        "double ms",
    )
    report.say(table(head, rows, most=_MOST_ROWS))
    solver, wall = numbers["solver"], numbers["wall_s"]
    report.say(
        f"{numbers['ending']} after {numbers['duration_s']:.4g} s "
        f"and {len(rows)} footsteps on a slope of {numbers['slope_rad']:g} rad"
    )
    report.say(
        f"energy left open {numbers['energy_residual_J']:.1e} J "
        f"of {numbers['gravity_work_J']:.4g} J of gravity's work"
    )
    report.say(
        f"{solver['name']} ({solver['engine']}): {solver['accepted']} steps accepted, "
        f"{solver['rejected']} rejected; "
        f"import {wall['import']:.1f} s, compile {wall['compile']:.1f} s, run {wall['run']:.3f} s"
    )

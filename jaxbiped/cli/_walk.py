"""`jaxbiped walk`: simulate the seed's walker and print its footsteps."""

import dataclasses
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped._ending import Ending
from jaxbiped._progress import stage
from jaxbiped._types import JsonObject
from jaxbiped.caching import _import_time
from jaxbiped.cli._driven import cost_sentence, walk_cost
from jaxbiped.cli._held import constraint_numbers, constraint_sentence
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._rigid_walk import run_rigid_walk
from jaxbiped.cli._warnings import ending_name, relative_residual, walk_warnings
from jaxbiped.cli.commands._walk import Walk
from jaxbiped.dynamics._state import RigidState, State
from jaxbiped.measure._energy_ledger import energy_ledger
from jaxbiped.measure._footsteps import Footsteps, footsteps
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.simulate._accurate_walk import accurate_walk
from jaxbiped.simulate._simulation import Simulation
from jaxbiped.solve._error_estimate import error_numbers, error_sentence
from jaxbiped.solve._trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_ROWS = 24
_ROOM = 1 << 17
"""Steps that XLA finds room for at first; a walk that takes more is run again with more room."""
_SHOWN = 60.0
"""The part of a long walk that is animated and can be watched [s]."""


def run(options: Walk) -> int:
    """Runs the command; returns the exit code."""
    imported = time.perf_counter()
    scene = options.scene.scene()
    state = options.start.state(scene)
    if isinstance(scene, RigidScene):
        assert isinstance(state, RigidState)
        return run_rigid_walk(scene, state, options.solve, options.output)
    assert isinstance(state, State)
    with stage("preparing the start"):
        request = _request(options, scene, state)
    options.output.check()
    began = time.perf_counter()
    trajectory, seconds = _simulate(request, options.solve.wanted())
    wall = {
        "import": imported - _import_time.IMPORT_BEGAN,
        "compile": time.perf_counter() - began - seconds,
        "run": seconds,
    }
    _report(options, scene, trajectory, wall, float(request.rtol))
    return 1 if trajectory.outcome == Ending.SOLVER_FAILED else 0


def _request(options: Walk, scene: Scene | RedundantScene, state: State) -> Simulation:
    return Simulation.prepare(
        scene,
        state,
        duration=options.solve.duration,
        solver=options.solve.solver,
        **options.solve.tolerances(),
        dt=options.solve.dt,
        engine=options.solve.engine,
        max_solver_steps=options.solve.most_steps(),
    )


def _report(
    options: Walk, scene: Any, trajectory: Trajectory, wall: dict[str, float], tolerance: float
) -> None:
    with stage("measuring the footsteps"):
        steps = footsteps(scene, trajectory)
        ledger = energy_ledger(scene, trajectory)
    known = tolerance if trajectory.error is None else trajectory.error.rtol
    rtol = known if options.solve.dt is None else None
    numbers: JsonObject = {
        "ending": ending_name(scene, trajectory),
        "slope_rad": float(scene.ground.slope),
        "duration_s": float(np.asarray(trajectory.t)[-1]),
        "steps": _step_list(steps),
        "energy_residual_J": float(ledger.residual[0]),
        "energy_residual_relative": relative_residual(ledger),
        "gravity_work_J": float(ledger.gravity_work[0]),
        "solver": {
            "name": options.solve.solver,
            "rtol": rtol,
            "dt": options.solve.dt,
            "engine": trajectory.engine,
            "accepted": int(trajectory.accepted),
            "rejected": int(trajectory.rejected),
        },
        "wall_s": wall,
    }
    if trajectory.error is not None:
        numbers["error"] = error_numbers(trajectory.error)
    cost: JsonObject = {}
    if scene.actuation is not None:
        cost = walk_cost(scene, trajectory)
        numbers |= {"actuation_work_J": float(ledger.actuation_work[0])} | cost
    numbers["warnings"] = walk_warnings(scene, numbers, rtol=rtol)
    report = Report(options.output.json)
    if scene.redundant:
        numbers["constraints"] = constraint_numbers(scene, trajectory)
    _print(report, numbers)
    if cost:
        report.say(cost_sentence(cost))
    if trajectory.error is not None:
        report.say(error_sentence(trajectory.error))
    for sentence in numbers["warnings"]:
        report.say(f"WARNING: {sentence}")
    if scene.redundant:
        report.say(constraint_sentence(numbers["constraints"]))
    if options.output.out is not None:
        with stage("drawing the figures and the animation"):
            paths = write_outputs(scene, trajectory, options.output.out)
        for path in paths:
            report.say(f"wrote {path}")
    report.finish(numbers)


def _simulate(request: Simulation, wanted: float | None) -> tuple[Trajectory, float]:
    """The trajectory, and how long the solve took once it was compiled [s].

    To a `wanted` relative error it takes several solves, compiling among them.
    """
    if wanted is not None:
        began = time.perf_counter()
        with warnings.catch_warnings(), stage("simulating, with error bars"):
            warnings.simplefilter("ignore", RuntimeWarning)  # the table says it
            return accurate_walk(request, wanted), time.perf_counter() - began
    most = room = request.max_solver_steps
    if request.engine == "xla" and request.dt is None:
        # It makes room beforehand, and time asked for need not be walked.
        room = min(most, _ROOM)
    while True:
        trajectory, seconds = _run(dataclasses.replace(request, max_solver_steps=room))
        if room == most or trajectory.outcome is not Ending.OUT_OF_STEPS:
            return trajectory, seconds
        room = min(most, 4 * room)


def _run(request: Simulation) -> tuple[Trajectory, float]:
    """The trajectory of a request and how long it took once it was compiled [s]."""
    with stage("compiling the simulation (first time for this kind of scene)"):
        program = request.compile()
    compiled = time.perf_counter()
    with stage(f"simulating {float(request.duration):g} s"):
        trajectory = program()
    return trajectory, time.perf_counter() - compiled


def write_outputs(scene: Any, trajectory: Trajectory, out: Path) -> list[Path]:
    """Writes the figures, the animations and the trajectory; returns their paths."""
    from jaxbiped import plot
    from jaxbiped.measure._dataset import trajectory_dataset

    figures: dict[str, Callable[[Scene, Trajectory], Figure]] = {
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
    shown = _beginning(trajectory)
    page = plot.view(scene, shown).save(out / "walk.html")
    plot.save_animation(plot.animate(scene, shown), out / "walk.gif")
    return [out / "trajectory.nc", *(out / name for name in figures), out / "walk.gif", page]


def _beginning(trajectory: Trajectory) -> Trajectory:
    """The part of a walk that is animated."""
    count = int(np.searchsorted(np.asarray(trajectory.t), _SHOWN, side="right"))
    t, state = jtu.tree_map(lambda leaf: leaf[:count], (trajectory.t, trajectory.state))
    return dataclasses.replace(trajectory, t=t, state=state)


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


def _print(report: Report, numbers: JsonObject) -> None:
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

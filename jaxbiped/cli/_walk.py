"""`jaxbiped walk`: simulate a walker and print its footsteps."""

import dataclasses
import time
import warnings
from typing import Annotated, Any, TypeAlias

import jaxbiped as jb
from jaxbiped._checks import ArgumentError
from jaxbiped._files import JsonObject
from jaxbiped._progress import stage
from jaxbiped.caching import IMPORT_BEGAN
from jaxbiped.cli import _options as options
from jaxbiped.cli._report import Report, columns
from jaxbiped.cli._scene_options import SceneOptions
from jaxbiped.cli._start_options import StartOptions

MOST_STEPS = 1 << 20
"""Solver's steps that nobody asked for more than: about 25 minutes of the seed's walk."""
_STEPS_OF_TEN_SECONDS = 65536
_MOST_STRIKES = 4096
_Walked: TypeAlias = "tuple[jb.Trajectory[Any], dict[str, Any], dict[str, float]]"
"""A walk, its solver's settings, and times [s]."""
_ROOM = 1 << 17
"""Steps that XLA finds room for at first; a walk that takes more is run again with more room."""
_MOST_ROWS = 24
_FIRST = {"step": "{0[step]}", "leg": "{0[leg]}"}
_FOOTSTEP = {
    "step": "{0[step]}",
    "time s": "{0[time_s]:.4f}",
    "period s": "{0[period_s]:.4f}",
    "length m": "{0[length_m]:.4f}",
    "speed m/s": "{0[speed_m_s]:.4f}",
}
_FORCES = {
    "peak N": "{0[peak_normal_N]:.1f}",
    "depth mm": "{0[depth_mm]:.3f}",
    "double ms": "{0[double_ms]:.3f}",
}
_LINES: tuple[str, ...] = (
    "{0[ending]} after {0[duration_s]:.4g} s and {0[footsteps]} footsteps on a slope of "
    "{0[slope_rad]:g} rad",
    "energy left open {0[energy_residual_J]:.1e} J of {0[gravity_work_J]:.4g} J of gravity's work",
    "{0[solver][name]} ({0[solver][engine]}): {0[solver][accepted]} steps accepted, "
    "{0[solver][rejected]} rejected; import {0[wall_s][import]:.1f} s, compile "
    "{0[wall_s][compile]:.1f} s, run {0[wall_s][run]:.3f} s",
)
_RIGID_LINES = (
    "{0[ending]} after {0[duration_s]:.4g} s and {0[footsteps]} whole footsteps on rigid feet on a "
    "slope of {0[slope_rad]:g} rad",
    "{0[solver][name]} ({0[solver][engine]}): {0[solver][attempted]} steps attempted; import "
    "{0[wall_s][import]:.1f} s, compile {0[wall_s][compile]:.1f} s, run {0[wall_s][run]:.4f} s",
)
_CONSTRAINTS = (
    "{0[method]}: the hip opens by at most {0[max_violation_m]:.1e} m and "
    "{0[max_violation_rate]:.1e} m/s, and carries at most {0[max_hip_force_N]:.0f} N; the start "
    "was corrected by {0[start_correction_m]:.1e} m and {0[start_correction_m_s]:.1e} m/s"
)


class SolveOptions(options.Options, of=("simulate",)):
    """Duration and solver."""

    duration: Annotated[float, options.positive("s")] = 10.0
    """Simulated time [s]."""
    solver: Annotated[str, options.one_of("solvers.SOLVERS")]
    """Name of the solver: rodas3p, rodas4, rodas4p or rodas5p, or one of diffrax's."""
    accuracy: options.AnyAccuracy | None = None
    """Accuracy, instead of tolerances: draft, balanced or tight; or a relative error like 1e-4."""
    rtol: Annotated[float | None, options.positive()] = None
    """Relative tolerance. If omitted: 1e-6."""
    atol: Annotated[float | None, options.positive()] = None
    """Absolute tolerance (SI units). If omitted: a hundredth of the relative one."""
    dt: Annotated[float | None, options.positive("s")] = None
    """Fixed step size [s], instead of tolerances; required by --solver euler."""
    max_solver_steps: options.Count | None = None
    """Maximum number of solver steps. If omitted: 65536 per ten seconds, at most 1048576."""
    engine: options.Engine

    def check(self) -> None:
        super().check()
        for name in ("accuracy", "dt") if self.rtol is not None else ():
            if getattr(self, name) is not None:
                raise ArgumentError(
                    f"rtol = {self.rtol:g} is not allowed with {name} = {getattr(self, name)}: "
                    "give one of them."
                )

    def check_rolling(self) -> None:
        """Raises `ArgumentError` for what rigid feet have no use for."""
        for name in ("solver", "atol", "dt"):
            if getattr(self, name) != getattr(SolveOptions, name):
                raise ArgumentError(
                    f'{name} = {getattr(self, name)} is not allowed with model = "rigid": its '
                    "steps are dopri8's, with an absolute tolerance of a hundredth of the "
                    "relative one."
                )

    def wanted(self) -> float | None:
        """The relative error asked for; None where tolerances decide. Raises `ArgumentError`."""
        if self.accuracy is None:
            return None
        from jaxbiped.simulate._accurate_walk import check_accurate_walk

        return check_accurate_walk(options.accuracy_told(self.accuracy), atol=self.atol, dt=self.dt)

    def tolerances(self) -> dict[str, Any]:
        """What decides on the steps' sizes, as `simulate` takes it; raises `ArgumentError`."""
        if self.wanted() is not None:
            return {}
        if self.accuracy is not None:
            return {"accuracy": self.accuracy, "atol": self.atol}
        return {"rtol": self.relative, "atol": self.atol}

    @property
    def relative(self) -> float:
        """The relative tolerance, where no accuracy is given."""
        return 1e-6 if self.rtol is None else self.rtol

    def most_steps(self) -> int:
        if self.max_solver_steps is not None:
            return self.max_solver_steps
        if self.dt is not None:
            return MOST_STEPS
        return int(min(MOST_STEPS, _STEPS_OF_TEN_SECONDS * max(1.0, self.duration / 10.0)))


class Walk(options.Command):
    """Simulate a walker from a start; print its footsteps and how it ended."""

    scene: SceneOptions
    start: StartOptions
    solve: SolveOptions
    output: options.OutputOptions

    def run(self) -> int:
        from jaxbiped.cli._walk_report import footstep_csv, walk_numbers, write_outputs

        imported = time.perf_counter()
        scene = self.scene.scene()
        state = self.start.start(scene, self.scene.walker)
        walked = self._roll if isinstance(scene, jb.RigidScene) else self._walk
        walk, settings, wall = walked(scene, state)
        wall["import"] = imported - IMPORT_BEGAN
        numbers = walk_numbers(scene, walk, settings, wall)
        report = Report(self.output.json, self.output.csv)
        _say(report, numbers, walk)
        report.finish(numbers, lambda: footstep_csv(numbers["steps"]))
        if self.output.out is not None:
            with stage("drawing the figures and the animation"):
                paths = write_outputs(scene, state, walk, self.output)
            report.wrote(paths)
        unfinished = walk.outcome in (jb.Ending.SOLVER_FAILED, jb.Ending.OUT_OF_STEPS)
        return int(unfinished or (walk.error is not None and not walk.error.met))

    def _walk(self, scene: Any, state: Any) -> _Walked:
        solve = self.solve
        with stage("preparing the start"):
            request = jb.Simulation.prepare(
                scene,
                state,
                duration=solve.duration,
                solver=solve.solver,
                **solve.tolerances(),
                dt=solve.dt,
                engine=solve.engine,
                max_solver_steps=solve.most_steps(),
            )
        self.output.make_folder()
        began = time.perf_counter()
        walk, seconds = _simulate(request, solve.wanted())
        wall = {"compile": time.perf_counter() - began - seconds, "run": seconds}
        tolerance = float(request.rtol) if walk.error is None else walk.error.rtol
        rtol = tolerance if solve.dt is None else None
        return walk, {"name": solve.solver, "rtol": rtol, "dt": solve.dt}, wall

    def _roll(self, scene: Any, state: Any) -> _Walked:
        solve = self.solve
        self.output.make_folder()
        solve.check_rolling()
        wanted, tolerances = solve.wanted(), solve.tolerances()
        tolerances.pop("atol", None)
        how = dict(
            duration=solve.duration,
            engine=solve.engine,
            max_arrivals=_MOST_STRIKES,
            max_solver_steps=solve.most_steps(),
            **(tolerances if wanted is None else {"accuracy": wanted}),
        )
        prepared = time.perf_counter()
        with stage("compiling the simulation (first time for this kind of scene)"):
            _rigid_walk(scene, state, how)
        compiled = time.perf_counter()
        with stage(f"simulating {solve.duration:g} s"):
            walk = _rigid_walk(scene, state, how)
        run = time.perf_counter() - compiled
        # The first run compiles; what a run takes by itself is the second one's.
        wall = {"compile": compiled - prepared - run, "run": run}
        rtol = solve.relative
        if walk.error is not None:
            rtol = walk.error.rtol
        elif solve.accuracy is not None:
            rtol = jb.ACCURACIES[solve.accuracy].rigid_walk
        return walk, {"name": "dopri8", "rtol": rtol}, wall


def _rigid_walk(scene: "jb.RigidScene", state: Any, how: dict[str, Any]) -> "jb.Trajectory[Any]":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the table says it
        walk = jb.rigid_walk(scene, state, **how)
    walk.t.block_until_ready()
    return walk


def _simulate(request: "jb.Simulation", wanted: float | None) -> "tuple[jb.Trajectory[Any], float]":
    """The trajectory, and how long the solve took once it was compiled [s].

    To a `wanted` relative error it takes several solves, compiling among them.
    """
    if wanted is not None:
        from jaxbiped.simulate._accurate_walk import accurate_walk

        began = time.perf_counter()
        with warnings.catch_warnings(), stage("simulating, with error bars"):
            warnings.simplefilter("ignore", RuntimeWarning)  # the table says it
            return accurate_walk(request, wanted), time.perf_counter() - began
    most = room = request.max_solver_steps
    if request.engine == "xla" and request.dt is None:
        # It makes room beforehand, and time asked for need not be walked.
        room = min(most, _ROOM)
    while True:
        with stage("compiling the simulation (first time for this kind of scene)"):
            program = dataclasses.replace(request, max_solver_steps=room).compile()
        compiled = time.perf_counter()
        with stage(f"simulating {float(request.duration):g} s"):
            trajectory = program()
        seconds = time.perf_counter() - compiled
        if room == most or trajectory.outcome is not jb.Ending.OUT_OF_STEPS:
            return trajectory, seconds
        room = min(most, 4 * room)


def _say(report: Report, numbers: JsonObject, walk: "jb.Trajectory[Any]") -> None:
    """What people read of a walk before its files."""
    from jaxbiped.cli._walk_report import cost_sentence
    from jaxbiped.solve._error_estimate import error_sentence

    layout, lines = _FIRST | _FOOTSTEP | _FORCES, _LINES
    if "model" in numbers:
        layout, lines = _FOOTSTEP, _RIGID_LINES
    rows = []
    for k, each in enumerate(numbers["steps"]):
        row = each | {"step": k + 1}
        if "peak_normal_N" in each:
            row["depth_mm"] = 1e3 * each["max_penetration_m"]
            row["double_ms"] = 1e3 * each["double_support_s"]
        rows.append(row)
    known = {"footsteps": len(rows)} | numbers
    report.say(columns(layout, rows, most=_MOST_ROWS), *(line.format(known) for line in lines))
    if "cost_of_transport" in numbers:
        report.say(cost_sentence(numbers))
    if walk.error is not None:
        report.say(error_sentence(walk.error))
    for sentence in numbers["warnings"]:
        report.say(f"WARNING: {sentence}")
    if "constraints" in numbers:
        report.say(_CONSTRAINTS.format(numbers["constraints"]))

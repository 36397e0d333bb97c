"""What is tried on each mechanism: one number a capability."""

import dataclasses
import functools
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
from _mechanisms import Case

import jaxbiped as jb
from jaxbiped.compiler import ARCHITECTURES, LANES
from jaxbiped.trade import WalkTrade, Way

CLEARANCES = {jb.laws.StanceRotation: "stance-rotation", jb.laws.AlwaysTouching: "always-touching"}
"""Rules of clearance by the names that the command line has."""


class Trial:
    """A mechanism, what several capabilities need of it, and where its pages and animations go."""

    def __init__(self, name: str, case: Case, folder: Path) -> None:
        self.name, self.case, self.scene, self.folder = name, case, case.scene, folder
        folder.mkdir(exist_ok=True)

    @functools.cached_property
    def gait(self) -> jb.Gait:
        """Its gait near the start, with the derivatives of its measures."""
        how = dict(parameters=("slope",), radius_sensitivities=False)
        found = jb.find_gait(self.scene, self.case.guess, **how)
        if found.outcome != jb.gait.Search.FOUND:
            raise LookupError(f"no gait near the start: {found.outcome}.")
        return found

    @functools.cached_property
    def start(self) -> Any:
        """The state with which the gait's cycle begins, where it is known."""
        try:
            return self.gait.measures.state
        except (jb.ArgumentError, LookupError):
            return self.case.guess

    @functools.cached_property
    def walk(self) -> jb.Trajectory:
        """Four footsteps from there."""
        return jb.simulate(self.scene, self.start, footsteps=4)

    @functools.cached_property
    def labelling(self) -> jb.labels.Labelling:
        """A labelling that knows the gait."""
        return jb.labelling(self.scene, guess=self.gait.measures.state, footsteps=15)

    @property
    def mass(self) -> str:
        """The name of its first parameter that is a mass."""
        quantities = jb.parameter_quantities(self.scene)
        return next(name for name in quantities if quantities[name].unit == "kg")


def accurate_walk(trial: Trial) -> float:
    found = jb.simulate(trial.scene, trial.start, footsteps=2, accuracy=1e-6, save="end")
    return float(max(np.max(leaf) for leaf in jax.tree.leaves(found.error)))


def bristles(trial: Trial) -> float:
    law = jb.laws.LuGre.like_seed(jb.seed_scene().friction)
    scene = dataclasses.replace(trial.scene, friction=law)
    return float(jb.simulate(scene, trial.start, footsteps=4).t[-1])


def tradeoff(trial: Trial) -> float:
    study = WalkTrade(trial.scene, trial.start, duration=0.5, repeats=1)
    row = study.row(Way("rodas4p", "lanes", "rtol=1e-6", 1e-6), study.truth())
    if row.errors.get("state") is None:
        raise LookupError(row.outcome)
    return float(row.errors["state"])


def ledger(trial: Trial) -> float:
    books = jb.measure.energy_ledger(trial.scene, trial.walk)
    return float(abs(books.residual[0]) / books.gravity_work[0])


def transport(trial: Trial) -> float:
    return float(np.mean(jb.measure.cost_of_transport(trial.scene, trial.walk).cost))


def shock(trial: Trial) -> float:
    how = dict(gradients=False, tolerance=1e-3)
    return float(jb.labels.nearest_failure(trial.labelling, **how).distance)


def slope_of_walk(trial: Trial) -> float:
    def place(slope: Any) -> Any:
        scene = jb.with_parameters(trial.scene, {"slope": slope})
        return jb.simulate(scene, trial.start, footsteps=1, save="end").final

    slope = trial.scene.ground.slope
    return float(jax.jacfwd(place)(slope)[0])


def modes(trial: Trial) -> float:
    """Of d time/d slope of a return: how far both modes are off differences, relative."""

    def duration(slope: Any, gradient: Any = None) -> Any:
        scene = jb.with_parameters(trial.scene, {"slope": slope})
        return jb.return_map(scene, trial.start, gradient=gradient, accuracy="tight").time

    slope = trial.scene.ground.slope
    found = jax.jacfwd(duration)(slope), jax.grad(duration)(slope, jb.gait.Reverse())
    sides = [float(duration(slope * (1.0 + h))) for h in (1e-4, -1e-4)]
    return float(np.max(np.abs(np.array(found) * 2e-4 * slope / (sides[0] - sides[1]) - 1.0)))


def period_of(where: str, *given: Any) -> float:
    """Of a gait that is searched from a scene, and from a guess or from none."""
    found = jb.find_gait(*given, parameters=(), radius_sensitivities=False)
    if found.outcome != jb.gait.Search.FOUND:
        raise LookupError(f"no gait {where}: {found.outcome}.")
    return float(found.measures.period)


def elasticity(trial: Trial) -> float:
    place = trial.gait.parameters.index("slope")
    return float(trial.gait.elasticities.period[place])


def gradient(trial: Trial) -> float:
    """By reverse mode through the gait, of its period with respect to the slope, relative."""

    def period(slope: Any) -> Any:
        scene = jb.with_parameters(trial.scene, {"slope": slope})
        return jb.gait_measures(scene, trial.gait.measures.state).period

    slope = trial.scene.ground.slope
    return float(jax.grad(period)(slope) * slope / trial.gait.measures.period)


def branch(trial: Trial) -> int:
    slope = float(trial.scene.ground.slope)
    bounds = (0.9 * slope, 1.1 * slope)
    return len(jb.continue_gait(trial.scene, "slope", bounds=bounds, guess=trial.gait))


def bifurcations(trial: Trial) -> int:
    slope = float(trial.scene.ground.slope)
    bounds = (0.25 * slope, 3.0 * slope)
    return len(jb.continue_gait(trial.scene, "slope", bounds=bounds, guess=trial.gait).bifurcations)


def grid(trial: Trial) -> int:
    slopes = float(trial.scene.ground.slope) * np.array([0.98, 1.0, 1.02])
    found = jb.gait_sweep(trial.scene, {"slope": slopes}, parameters=(), radius_sensitivities=False)
    return int((found.ending == int(jb.gait.Search.FOUND)).sum())


def basin(trial: Trial) -> float:
    structure = trial.scene.mechanism.structure
    swings, stands = (structure.bodies[i] for i in structure.pairs[0]) if structure.pairs else "12"
    at = trial.gait.measures.state._asdict()
    axes = {
        name: float(at[name]) + np.linspace(-half, half, 12)
        for name, half in ((f"theta_{swings}", 0.2), (f"omega_{stands}", 0.5))
    }
    starts = jb.starts.grid(trial.scene, axes, base=trial.gait.measures.state)
    found = jb.sweep(trial.labelling, starts, look_for_gaits=False)
    return float(jb.basins.fractions(found.label)["walking"].estimate)


def optimum(trial: Trial) -> float:
    values = jb.parameter_values(trial.scene)
    mass = float(values[trial.mass])
    best = jb.optimise_gait(
        trial.scene, vary={trial.mass: (0.98 * mass, 1.02 * mass)}, maximise="speed", iterations=8
    )
    return float(best.objective / trial.gait.measures.speed - 1.0)


def fit(trial: Trial) -> float:
    seen = jb.identify.MeasuredGait({"period": (float(trial.gait.measures.period), 1e-4)})
    name = trial.mass
    true = float(jb.parameter_values(trial.scene)[name])
    begun = jb.with_parameters(trial.scene, {name: 1.01 * true})
    return float(jb.fit_gait(begun, (name,), seen).estimates[name] / true - 1.0)


def redundant(trial: Trial) -> float:
    """Accelerations by all methods beside those in minimal coordinates, relative to the largest."""

    @jax.jit
    def every(scene: jb.Scene, state: Any) -> tuple[Any, list[Any]]:
        held = [jb.RedundantScene(scene, each) for each in jb.constraints.CONSTRAINT_METHODS]
        starts = [jb.dynamics.redundant_state(each, state) for each in held]
        motions = map(jb.dynamics.redundant_motion, held, starts)
        return jb.dynamics.accelerations(scene, state), [each.minimal for each in motions]

    expected, found = every(trial.scene, trial.start)
    gaps = np.abs(np.array(found) - np.array(expected))
    return float(np.max(gaps) / np.max(np.abs(expected)))


def engines(trial: Trial) -> float:
    """Explicit Euler through XLA, in steps at which friction is stable, beside lanes."""
    after = dict(duration=2e-3, save="end")
    euler = dict(solver="euler", dt=2.5e-7, max_solver_steps=10_000, engine="xla")
    ends = [
        jax.jit(lambda scene, start, how=how: jb.simulate(scene, start, **after, **how).final)
        for how in (dict(engine="lanes"), euler)
    ]
    there = [each(trial.scene, trial.start) for each in ends]
    return float(max(abs(np.subtract(*pair)) for pair in zip(*there, strict=True)))


def device(trial: Trial) -> int:
    how = dict(duration=1.0, save="end", engine="lanes")
    request = jb.Simulation.prepare(trial.scene, trial.start, **how).lane_request()
    lines = LANES.compile(request).kernel.ptx(ARCHITECTURES[9, 0]).splitlines()
    return sum(line.startswith("\t") and line.endswith(";") for line in lines)


def animation(trial: Trial) -> int:
    made = jb.plot.animate(trial.scene, trial.walk, frames_per_second=10.0)
    frames = list(made.new_frame_seq())
    made.save(trial.folder / "walk.gif", writer="pillow")
    return len(frames)


def viewer(trial: Trial) -> float:
    path = trial.folder / "walk.html"
    jb.plot.view(trial.scene, trial.walk).save(path)
    return path.stat().st_size / 1e3


def command(trial: Trial) -> int:
    """Footsteps of `jaxbiped walk` of a walker in a file."""
    file, numbers = trial.folder / "walker.py", trial.folder / "walk.json"
    known = f"import sys\n\nsys.path.insert(0, {str(Path(__file__).parent)!r})\n"
    made = f"from _mechanisms import cases\n\nwalker = cases()[{trial.name!r}].scene.walker\n"
    file.write_text(known + made)
    start = (f"{name}={value}" for name, value in trial.case.start.items())
    words = {
        "--walker": [f"{file}:walker"],
        "--slope": [str(float(trial.scene.ground.slope))],
        "--clearance": [CLEARANCES[type(trial.scene.clearance)]],
        "--standing": [trial.case.standing],
        "--state": list(start),
        "--duration": ["2"],
        "--out": [str(trial.folder)],
        "--json": [str(numbers)],
    }
    flags = [word for flag, values in words.items() for word in (flag, *values)]
    run = [sys.executable, "-m", "jaxbiped", "walk", *flags]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    if done.returncode:
        raise LookupError(done.stderr.strip().splitlines()[-1])
    return len(json.loads(numbers.read_text())["steps"])


def playground(trial: Trial) -> float:
    path = trial.folder / "play.html"
    jb.plot.playground(trial.scene, trial.start).save(path)
    return path.stat().st_size / 1e3


class Capability(NamedTuple):
    """A number of a mechanism that one capability gives, and what that number is."""

    measured: Callable[[Trial], float | int]
    meaning: str


CAPABILITIES = {
    "walk": Capability(lambda t: float(t.walk.t[-1]), "time of four footsteps, s"),
    "footsteps": Capability(lambda t: len(jb.footsteps(t.scene, t.walk).period_s), "in that walk"),
    "energy ledger": Capability(ledger, "residual over gravity's work"),
    "cost of transport": Capability(transport, "of the four footsteps"),
    "operations": Capability(
        lambda t: sum(jb.measure.operation_counts(t.scene).values()),
        "of one evaluation of the vector field",
    ),
    "dataset": Capability(
        lambda t: len(jb.measure.trajectory_dataset(t.scene, t.walk).data_vars), "variables"
    ),
    "figure": Capability(
        lambda t: len(jb.plot.leg_angles(t.scene, t.walk).axes[0].lines),
        "lines of the angles' figure",
    ),
    "animation": Capability(animation, "frames"),
    "viewer": Capability(viewer, "kB of the page"),
    "redundant coordinates": Capability(
        redundant, "largest difference of accelerations, seven methods"
    ),
    "accuracy=1e-6": Capability(accurate_walk, "error bar of two footsteps"),
    "bristles": Capability(bristles, "time of four footsteps with LuGre's friction, s"),
    "trade": Capability(tradeoff, "error of `rodas4p` at 1e-6 after 0.5 s, scaled"),
    "gait": Capability(lambda t: float(t.gait.measures.period), "period, s"),
    "multipliers": Capability(lambda t: float(t.gait.measures.spectral_radius), "spectral radius"),
    "unit multiplier": Capability(lambda t: float(t.gait.unit_multiplier_error), "distance from 1"),
    "sensitivities": Capability(elasticity, "elasticity of the period with respect to the slope"),
    "branch": Capability(branch, "points from 0.9 to 1.1 of the slope"),
    "bifurcations": Capability(bifurcations, "on the branch from 0.25 to 3 times the slope"),
    "basin": Capability(basin, "share of 144 starts that walk"),
    "nearest_failure": Capability(shock, "smallest fatal push, scaled"),
    "gait without a guess": Capability(
        lambda t: period_of("without a guess", t.scene), "period, s"
    ),
    "gait_sweep": Capability(grid, "gaits found at three slopes"),
    "optimum": Capability(optimum, "relative gain of speed, a mass varied by 2 %"),
    "fit": Capability(fit, "relative error of a mass"),
    "gradient": Capability(gradient, "the same elasticity by `jax.grad`"),
    "slope of a walk": Capability(slope_of_walk, "d hip_x/d slope after a footstep, m/rad"),
    "both modes": Capability(
        modes, "of d time/d slope of a return, relative difference from differences"
    ),
    "rigid feet": Capability(
        lambda t: period_of("on rigid feet", *t.case.on_rigid_feet()), "period, s"
    ),
    "command line": Capability(command, "footsteps of `jaxbiped walk --walker FILE.py:NAME`"),
    "playground": Capability(playground, "kB of the page"),
    "both engines": Capability(engines, "largest difference after 2 ms, XLA by explicit Euler"),
    "CUDA": Capability(device, "PTX instructions of a walk's program for compute capability 9.0"),
}
"""What is tried, and what its number is."""

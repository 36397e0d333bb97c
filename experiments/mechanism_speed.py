"""Speed of a walker with five links beside numbalsoda and MuJoCo, and how a step's cost grows.

Writes mechanism_speed.png. Rates are for a second of the processor, all threads together. Also the
attempted steps and the time of rigid walks with knees beside the seed's rigid walk.
"""

# ruff: noqa: E402 (the cores are settled before JAX is imported)
import _cores

_cores.settle(2)

import dataclasses
import functools
import importlib.util
import time

import _mujoco
import jax
import numpy as np
from _experiment import Options, draw_by, experiment, label
from _mechanisms import Case, cases, kneed
from _scalar_field import address_of
from _timing import seconds_of, timed
from _walks import perturbed, scattered, walker
from matplotlib.ticker import LogLocator, NullFormatter
from reference.numbalsoda_solves import lsoda_batch

import jaxbiped as jb
from jaxbiped.compiler import LANES
from jaxbiped.plot.style import new_figure

DURATION = 1.5
"""About three footsteps [s]."""
OF_MUJOCO = 0.6
"""Of MuJoCo's walks [s], after which its own law of contact makes another step of them."""
COUNT, QUICK_COUNT, CHECKED = 512, 64, 16
"""Starts, and those whose error is measured."""
OURS, QUICK_OURS = (1e-4, 1e-5, 1e-6, 1e-7), (1e-5,)
THEIRS, QUICK_THEIRS = (1e-5, 1e-6, 1e-7, 1e-8), (1e-7,)
"""Relative tolerances; absolute ones are a hundredth."""
EXACT, WITNESS = 1e-11, 1e-11
"""Tolerances of the exact ends, and of numbalsoda's beside them."""
STEPS, QUICK_STEPS = (1e-3, 3e-4, 1e-4, 3e-5), (1e-3,)
"""Of MuJoCo [s]."""
BODIES, QUICK_BODIES = (2, 3, 4, 6, 8, 10), (2, 4)
"""Of the chains whose steps are counted."""
FOOTSTEPS, WALKS, QUICK_WALKS = 10, 1024, 32
"""Of rigid walks, and walks of each walker in one call."""
SCATTER = 1e-3
"""Of the rates at their starts, as a share of themselves."""
SEED = "seed"
FLOPS = {"fadd": 1, "fsub": 1, "fmul": 1, "fdiv": 1, "sqrt": 1, "fma": 2}
"""Of each operation of a graph."""


@experiment
def main(options: Options):
    case = cases()["five links"]
    rates = batches(case, options)
    chains = [chain_row(n) for n in options.sized(BODIES, QUICK_BODIES)]
    logs = np.log([[row["bodies"], row["operations"]] for row in chains])
    return {
        "duration_s": DURATION,
        "rates": rates,
        "chains": chains,
        "exponent": float(np.polyfit(*logs.T, 1)[0]),
        "gait_cpu_s": warm_gait(case, options.sized(5, 1)),
        "rigid_walks": rigid_rows(options.sized(WALKS, QUICK_WALKS), options.sized(9, 1)),
        "picture": draw(options, rates["rows"], chains),
    }


def batches(case: Case, options: Options):
    """Rows of ways and tolerances: what they simulate in a second, and how exactly."""
    begin = np.array([float(leaf) for leaf in case.guess])
    starts = perturbed(options.sized(COUNT, QUICK_COUNT), begin)
    checked, rows = starts[: options.sized(CHECKED, 4)], []
    exact, rounds = run_lanes(case, EXACT, checked), options.sized(2, 1)
    work = {
        ("lanes", rtol): functools.partial(run_lanes, case, rtol)
        for rtol in options.sized(OURS, QUICK_OURS)
    }
    floor = None
    if all(importlib.util.find_spec(name) for name in ("numba", "numbalsoda")):
        solve, times = lsoda_of(case), np.array([0.0, DURATION])

        def peer(rtol, some):
            return solve(some, times, rtol, 1e-2 * rtol)

        floor = float(np.max(np.abs(peer(WITNESS, checked) - exact)))
        for rtol in options.sized(THEIRS, QUICK_THEIRS):
            work["numbalsoda", rtol] = functools.partial(peer, rtol)
    runs = {name: functools.partial(run, starts) for name, run in work.items()}
    seconds = seconds_of(runs, rounds, clock=time.process_time)
    for (way, rtol), run in work.items():
        errors = np.max(np.abs(run(checked) - exact), axis=1)
        rate = len(starts) * DURATION / seconds[way, rtol]
        rows.append(dict(way=way, rtol=rtol, error_median=float(np.median(errors)),
                         simulated_s_per_cpu_s=rate))  # fmt: skip
    if _mujoco.is_installed():
        steps = options.sized(STEPS, QUICK_STEPS)
        scene = on_a_spring(case.scene)
        rows += _mujoco.rows(scene, case.guess, steps, OF_MUJOCO, options.sized(2.0, 0.1))
    return {"rows": rows, "floor": floor}


def lsoda_of(case: Case):
    kind = type(case.guess)

    def field(*values):
        return tuple(jb.dynamics.vector_field(0.0, kind(*values), case.scene))

    return lsoda_batch(address_of(field, len(case.guess)))


def run_lanes(case: Case, rtol: float, starts: np.ndarray) -> np.ndarray:
    """Final states (n, 14) of walks from starts."""
    how = dict(duration=DURATION, engine="lanes", max_solver_steps=10**6)
    return walker(rtol, scene=case.scene, kind=type(case.guess), **how)(starts)[0]


def on_a_spring(scene: jb.Scene) -> jb.Scene:
    """The walker with its torso on a spring instead of motors, which MuJoCo has no likes of."""
    given = scene.mechanism.arguments()
    kept = [each for each in given["joints"] if not isinstance(each, jb.Motor)]
    spring = jb.Spring({"torso": 1, "normal": -1}, stiffness=4.0, damping=0.4)
    walker = jb.Mechanism(**given | {"joints": (*kept, spring)})
    return dataclasses.replace(scene, walker=walker)


def chain_row(n: int):
    """Operations of a step of a chain of n bodies, with a foot at its end and one on its first."""
    bodies = [
        jb.Body(f"b{i}", mass=1.0 / n, inertia=2e-3 / n, centre=0.2 / n,
                **(dict(parent=f"b{i - 1}", at=0.4 / n) if i else {}))
        for i in range(n)
    ]  # fmt: skip
    springs = [jb.Spring(f"b{i}", stiffness=0.5, damping=0.01) for i in range(1, n)]
    feet = [jb.Foot(f"b{i}", centre=0.4 / n, radius=0.02) for i in (0, n - 1)]
    seed = jb.seed_scene()
    walker = jb.Mechanism(root_mass=1.0, bodies=bodies, feet=feet, joints=springs)
    scene = jb.Scene(walker, seed.ground, seed.normal, seed.friction)
    flops, cpu = timed(lambda: flops_per_step(scene))[::2]
    return {"bodies": n, "operations": flops, "compiled_in_cpu_s": cpu}


def flops_per_step(scene):
    """Floating-point operations of an attempted step, by the very program that `simulate` runs."""
    how = dict(duration=1.0, save="end", engine="lanes")
    request = jb.Simulation.prepare(scene, scene.state(), **how).lane_request()
    return sum(FLOPS.get(each.op, 0) for each in LANES.compile(request).kernel.graph.body.values)


def warm_gait(case: Case, rounds: int) -> float:
    """Processor seconds of a gait with the sensitivities of all measures, compiled before."""

    def find():
        return jax.block_until_ready(jb.find_gait(case.scene, case.guess).elasticities)

    return seconds_of({0: find}, rounds, clock=time.process_time)[0]


def rigid_rows(count: int, rounds: int):
    """Steps of rigid walks, and their time over that of the seed's; walkers take turns."""
    work = {name: rigid_walks(*each, count) for name, each in rigid_walkers().items()}
    found = {name: run() for name, run in work.items()}
    seconds = seconds_of(work, rounds, warm=False, clock=time.process_time)
    return [
        {
            "walker": name,
            "footsteps": FOOTSTEPS,
            "accepted": float(np.mean(walks.accepted)),
            "rejected": float(np.mean(walks.rejected)),
            "walked": float(np.mean(np.asarray(walks.ending) == int(jb.Ending.WALKING))),
            "cpu_s_a_walk": seconds[name] / count,
            "ratio": seconds[name] / seconds[SEED],
        }
        for name, walks in found.items()
    ]


def rigid_walkers():
    """Of each walker the scene and a start on its gait, by name."""
    seed, mcgeer = jb.seed_scene(), jb.models.mcgeer(knees=True)
    scenes = {
        SEED: jb.RigidScene(seed.walker, seed.ground),
        "Hsu Chen": jb.models.hsu_chen(),
        "McGeer, knees": jb.RigidScene(kneed(), mcgeer.ground),
    }
    guess = scenes["Hsu Chen"].state(**jb.models.MODELS["hsu-chen"].starts["gait"])
    guesses, plain = {"Hsu Chen": guess}, dict(parameters=(), radius_sensitivities=False)
    return {
        name: (scene, jb.find_gait(scene, guesses.get(name), **plain).measures.state)
        for name, scene in scenes.items()
    }


def rigid_walks(scene, state, count):
    """A call that walks from starts about a gait; what is held keeps its rates alike."""
    moved = scattered(state, count, SCATTER, ("omega",))._asdict()
    for name in (name for name in moved if name == "omega_shank_2"):
        moved[name] = getattr(state, name) * moved["omega_thigh_2"] / state.omega_thigh_2
    how = dict(footsteps=FOOTSTEPS, save="end", engine="lanes")
    batch = jax.vmap(lambda start: jb.simulate(scene, start, **how))
    return lambda: batch(type(state)(**moved))


def draw(options: Options, rows, chains):
    left, right = new_figure(10.0, 4.0).subplots(1, 2)
    draw_by(left, "way", rows, "error_median", "simulated_s_per_cpu_s")
    label(left, "median error of the final state (SI units)", "simulated seconds (s per CPU s)",
          "Five links", log="xy")  # fmt: skip
    left.legend()
    right.plot(*np.array([[row["bodies"], 1e-3 * row["operations"]] for row in chains]).T, "o-")
    words = "bodies of a chain", "operations of a step (thousands)"
    label(right, *words, "Cost of a step", log="xy")
    for axis in (right.xaxis, right.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    return options.save(left.figure, "mechanism_speed.png")


if __name__ == "__main__":
    main()

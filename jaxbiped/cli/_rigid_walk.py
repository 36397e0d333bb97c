"""`jaxbiped walk --model rigid`: footsteps of the rigid walker."""

import dataclasses
import time
import warnings
from typing import Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped._progress import stage
from jaxbiped._types import JsonObject
from jaxbiped.caching import _import_time
from jaxbiped.cli._driven import cost_sentence, walk_cost
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._walk_options import OutputOptions, SolveOptions
from jaxbiped.cli._warnings import cut_short
from jaxbiped.dynamics._state import RigidState
from jaxbiped.scene._scene import RigidScene
from jaxbiped.simulate._rigid_walk import rigid_walk
from jaxbiped.solve._accuracy import ACCURACIES
from jaxbiped.solve._error_estimate import error_numbers, error_sentence
from jaxbiped.solve._trajectory import Arrivals, Trajectory

_MOST_ROWS = 24
_MOST_STRIKES = 4096
_SHOWN = 60.0
"""The part of a long walk that is drawn [s]."""


def run_rigid_walk(
    scene: RigidScene, state: RigidState, solve: SolveOptions, output: OutputOptions
) -> int:
    """Walks for the time asked for and prints the footsteps; returns the exit code.

    Raises:
        ArgumentError: an argument that is not allowed.
    """
    output.check()
    usual = SolveOptions()
    for name in ("solver", "atol", "dt"):
        if getattr(solve, name) != getattr(usual, name):
            raise ArgumentError(
                f'{name} = {getattr(solve, name)} is not allowed with model = "rigid": its steps '
                "are dopri8's, with an absolute tolerance of a hundredth of the relative one."
            )
    wanted = solve.wanted()
    options: dict[str, Any] = dict(
        duration=solve.duration,
        engine=solve.engine,
        max_arrivals=_MOST_STRIKES,
        max_solver_steps=solve.most_steps(),
    )
    if wanted is not None:
        options["accuracy"] = wanted
    elif solve.accuracy is not None:
        options["accuracy"] = solve.accuracy
    else:
        options["rtol"] = solve.relative
    prepared = time.perf_counter()
    with stage("compiling the simulation (first time for this kind of scene)"):
        _walk(scene, state, options)
    compiled = time.perf_counter()
    with stage(f"simulating {solve.duration:g} s"):
        walk = _walk(scene, state, options)
    assert walk.arrivals is not None
    finished = time.perf_counter()
    # The first run compiles; what a run takes by itself is the second one's.
    wall = {
        "import": prepared - _import_time.IMPORT_BEGAN,
        "compile": 2.0 * compiled - prepared - finished,
        "run": finished - compiled,
    }
    numbers: JsonObject = {
        "model": "rigid",
        "ending": str(walk.outcome),
        "slope_rad": float(scene.ground.slope),
        "duration_s": float(np.asarray(walk.t)[-1]),
        "footsteps": max(int(walk.arrivals.total) - 1, 0),
        "steps": _footsteps(scene, walk.arrivals),
        "solver": {
            "name": "dopri8",
            "rtol": _tolerance(solve, walk),
            "engine": walk.engine,
            "attempted": int(walk.attempted),
        },
        "wall_s": wall,
        "warnings": cut_short(str(walk.outcome), int(walk.attempted)),
    }
    if walk.error is not None:
        numbers["error"] = error_numbers(walk.error)
    cost = walk_cost(scene, walk) if scene.actuation is not None and numbers["steps"] else {}
    numbers |= cost
    if numbers["footsteps"] > len(numbers["steps"]):
        numbers["warnings"].append(f"only the first {len(numbers['steps'])} footsteps are listed")
    report = Report(output.json)
    _print(report, numbers)
    if cost:
        report.say(cost_sentence(cost))
    if walk.error is not None:
        report.say(error_sentence(walk.error))
    for sentence in numbers["warnings"]:
        report.say(f"WARNING: {sentence}")
    if output.out is not None:
        from jaxbiped import plot

        path = output.out / "leg_angles.png"
        shown = min(numbers["duration_s"], _SHOWN)
        plot.rigid_leg_angles(scene, state, duration=shown).savefig(path)
        page = plot.view(scene, _beginning(walk), start=state).save(output.out / "walk.html")
        for written in (path, page):
            report.say(f"wrote {written}")
    report.finish(numbers)
    return 1 if walk.outcome is Ending.SOLVER_FAILED else 0


def _walk(scene: RigidScene, state: RigidState, options: JsonObject) -> Trajectory[RigidState]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the table says it
        walk = rigid_walk(scene, state, **options)
    walk.t.block_until_ready()
    return walk


def _beginning(walk: Trajectory[RigidState]) -> Trajectory[RigidState]:
    """The part of a long walk that can be watched: as far as its last heel strike there."""
    assert walk.arrivals is not None
    if float(np.asarray(walk.t)[-1]) <= _SHOWN:
        return walk
    count = int(np.searchsorted(np.asarray(walk.arrivals.t), _SHOWN))
    t, state = jtu.tree_map(lambda leaf: leaf[:count], walk.arrivals[1:])
    return dataclasses.replace(walk, arrivals=Arrivals(walk.arrivals.total, t, state))


def _tolerance(solve: SolveOptions, walk: Trajectory[RigidState]) -> float:
    """The relative tolerance that the walk was solved with."""
    if walk.error is not None:
        return walk.error.rtol
    return solve.relative if solve.accuracy is None else ACCURACIES[solve.accuracy].rigid_walk


def _footsteps(scene: RigidScene, strikes: Arrivals[RigidState]) -> list[dict[str, float]]:
    """Each footstep from one heel strike to the next."""
    count, states = min(int(strikes.total), _MOST_STRIKES), strikes.state
    at = np.asarray(strikes.t)[:count]
    # Where the new stance foot comes down: under its centre, which lies on the leg's axis.
    reach = float(scene.walker.hip_to_foot)
    places = np.asarray(states.hip_x)[:count] + reach * np.sin(np.asarray(states.theta_2)[:count])
    return [
        {
            "time_s": float(at[k]),
            "period_s": float(at[k] - at[k - 1]),
            "length_m": float(places[k] - places[k - 1]),
            "speed_m_s": float((places[k] - places[k - 1]) / (at[k] - at[k - 1])),
        }
        for k in range(1, count)
    ]


def _print(report: Report, numbers: JsonObject) -> None:
    names = ("time_s", "period_s", "length_m", "speed_m_s")
    rows = [
        (str(k + 1), *(f"{row[name]:.4f}" for name in names))
        for k, row in enumerate(numbers["steps"])
    ]
    head = ("step", "time s", "period s", "length m", "speed m/s")
    report.say(table(head, rows, most=_MOST_ROWS))
    solver, wall = numbers["solver"], numbers["wall_s"]
    report.say(
        f"{numbers['ending']} after {numbers['duration_s']:.4g} s and {numbers['footsteps']} whole "
        f"footsteps on rigid feet on a slope of {numbers['slope_rad']:g} rad"
    )
    report.say(
        f"{solver['name']} ({solver['engine']}): {solver['attempted']} steps attempted; "
        f"import {wall['import']:.1f} s, compile {wall['compile']:.1f} s, run {wall['run']:.4f} s"
    )

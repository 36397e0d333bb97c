"""Report of a walk: footsteps, costs and warnings, for people and for programs."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax.tree_util as jtu
import numpy as np

import jaxbiped as jb
from jaxbiped._files import JsonObject
from jaxbiped._progress import stage
from jaxbiped._types import rows_of
from jaxbiped.cli._options import OutputOptions
from jaxbiped.cli._report import Report, columns
from jaxbiped.cli._walk_warnings import (
    ending_name,
    relative_residual,
    rigid_warnings,
    walk_warnings,
)
from jaxbiped.constraints._constraint_methods import name_of
from jaxbiped.measure._footsteps import footstep_dataset
from jaxbiped.measure._samples import from_start, places_of_standing
from jaxbiped.solve._error_estimate import error_numbers, error_sentence

_MOST_ROWS = 24
_SHOWN = 60.0
"""The part of a long walk that is drawn and can be watched [s]."""
_FIRST = {"step": "{0[step]}", "leg": "{0[leg]}"}
_FOOTSTEP = {
    "step": "{0[step]}",
    "time s": "{0[time_s]:.4f}",
    "period s": "{0[period_s]:.4f}",
    "length m": "{0[length_m]:.4f}",
    "speed m/s": "{0[speed_m_s]:.4f}",
}
_AT_LEAST = ("time_s", "period_s", "length_m", "speed_m_s")
"""What is known of footsteps on any feet."""
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


def report_walk(
    output: OutputOptions,
    scene: Any,
    state: Any,
    walk: "jb.Trajectory[Any]",
    settings: JsonObject,
    wall: dict[str, float],
) -> int:
    """Reports a walk from a start, of any kind; returns the exit code."""
    numbers: JsonObject = {
        "slope_rad": float(scene.ground.slope),
        "duration_s": float(np.asarray(walk.t)[-1]),
        "solver": settings | {"engine": walk.engine},
        "wall_s": wall,
    }
    if walk.error is not None:
        numbers["error"] = error_numbers(walk.error)
    rolls = isinstance(scene, jb.RigidScene)
    if rolls:
        numbers |= _rigid_numbers(scene, walk)
        numbers["solver"]["attempted"] = int(walk.attempted)
    else:
        numbers |= _compliant_numbers(scene, walk)
        numbers["solver"] |= {"accepted": int(walk.accepted), "rejected": int(walk.rejected)}
    if scene.actuation is not None and (numbers["steps"] or not rolls):
        numbers |= walk_cost(scene, walk)
    warnings_of = rigid_warnings if rolls else walk_warnings
    numbers["warnings"] = warnings_of(scene, numbers, rtol=settings["rtol"])
    report = Report(output.json, output.csv)
    _say(report, numbers, walk)
    if output.out is not None:
        with stage("drawing the figures and the animation"):
            if rolls:
                shown = from_start(scene, _rigid_beginning(walk), state)
                page = jb.plot.view(scene, shown).save(output.out / "walk.html")
                paths = [*output.draw(_motion_figures(scene, shown)), page]
            else:
                paths = write_outputs(scene, walk, output)
        report.wrote(paths)
    report.finish(numbers, lambda: footstep_csv(numbers["steps"]))
    return 1 if walk.outcome is jb.Ending.SOLVER_FAILED else 0


def _compliant_numbers(scene: Any, walk: "jb.Trajectory[Any]") -> JsonObject:
    with stage("measuring the footsteps"):
        rows = footstep_rows(jb.footsteps(scene, walk))
        legs = scene.mechanism.structure.legs
        struck = jb.measure.heel_strikes(scene, walk).foot[1:]
        rows = [{"leg": legs[leg - 1]} | row for leg, row in zip(struck, rows, strict=True)]
        ledger = jb.measure.energy_ledger(scene, walk)
    numbers: JsonObject = {
        "ending": ending_name(scene, walk),
        "steps": rows,
        "energy_residual_J": float(ledger.residual[0]),
        "energy_residual_relative": relative_residual(ledger),
        "gravity_work_J": float(ledger.gravity_work[0]),
    }
    if scene.actuation is not None:
        numbers["actuation_work_J"] = float(ledger.actuation_work[0])
    if scene.redundant:
        numbers["constraints"] = _constraint_numbers(scene, walk)
    return numbers


def _rigid_numbers(scene: "jb.RigidScene", walk: "jb.Trajectory[Any]") -> JsonObject:
    assert walk.arrivals is not None
    return {
        "model": "rigid",
        "ending": str(walk.outcome),
        "footsteps": max(int(walk.arrivals.total) - 1, 0),
        "steps": _rigid_footsteps(scene, walk.arrivals),
    }


def _say(report: Report, numbers: JsonObject, walk: "jb.Trajectory[Any]") -> None:
    """What people read of a walk before its files."""
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


def footstep_rows(steps: Any) -> list[dict[str, float]]:
    """The footsteps of a walk on compliant feet, each ready for JSON."""
    names = ("time_s", "period_s", "length_m", "speed_m_s", "peak_normal_N", "max_penetration_m",
             "double_support_s")  # fmt: skip
    return _rows({name: np.asarray(getattr(steps, name)) for name in names})


def footstep_csv(rows: list[dict[str, Any]]) -> str:
    """Footsteps of a walk on any feet as comma-separated values."""
    names = rows[0] if rows else _AT_LEAST
    found = footstep_dataset({name: [row[name] for row in rows] for name in names})
    return jb.measure.to_csv(found, "footstep")


def _rows(found: dict[str, np.ndarray]) -> list[dict[str, float]]:
    rows = np.transpose([*found.values()]).tolist()
    return [dict(zip(found, row, strict=True)) for row in rows]


def _rigid_footsteps(scene: "jb.RigidScene", strikes: Any) -> list[dict[str, float]]:
    """Each footstep from one heel strike to the next."""
    count, states = min(int(strikes.total), len(np.asarray(strikes.t))), strikes.state
    at = np.asarray(strikes.t)[:count]
    places = places_of_standing(scene, rows_of(states, slice(count)))
    periods, lengths = np.diff(at), np.diff(places)
    found = {"time_s": at[1:], "period_s": periods, "length_m": lengths}
    return _rows(found | {"speed_m_s": lengths / periods})


def _motion_figures(scene: Any, walk: "jb.Trajectory[Any]") -> dict[str, Callable[[], Any]]:
    """What draws a walk on any feet, by the names of the files."""
    return {
        "strobe": lambda: jb.plot.gait_strobe(scene, walk),
        "phase_portrait": lambda: jb.plot.phase_portrait(scene, walk),
        "leg_angles": lambda: jb.plot.leg_angles(scene, walk),
    }


def write_outputs(scene: Any, walk: "jb.Trajectory[Any]", output: OutputOptions) -> list[Path]:
    """Writes the figures, the animations and the trajectory; returns their paths."""
    assert output.out is not None
    # The numbers first: no picture that fails takes them away.
    data = output.out / "trajectory.nc"
    jb.measure.trajectory_dataset(scene, walk).to_netcdf(data)
    figures = _motion_figures(scene, walk) | {
        "penetrations": lambda: jb.plot.penetrations(scene, walk),
        "contact_forces": lambda: jb.plot.contact_forces(scene, walk),
    }
    paths, t = output.draw(figures), np.asarray(walk.t)
    count = int(np.searchsorted(t, _SHOWN, side="right"))
    t, state = jtu.tree_map(lambda leaf: leaf[:count], (walk.t, walk.state))
    shown = dataclasses.replace(walk, t=t, state=state)
    page = jb.plot.view(scene, shown).save(output.out / "walk.html")
    played = jb.plot.save_animation(jb.plot.animate(scene, shown), output.out / "walk.gif")
    return [data, *paths, played, page]


def _rigid_beginning(walk: "jb.Trajectory[Any]") -> "jb.Trajectory[Any]":
    """The part of a long walk that can be watched: as far as its last heel strike there."""
    assert walk.arrivals is not None
    if float(np.asarray(walk.t)[-1]) <= _SHOWN:
        return walk
    count = int(np.searchsorted(np.asarray(walk.arrivals.t), _SHOWN))
    t, state = jtu.tree_map(lambda leaf: leaf[:count], walk.arrivals[1:])
    return dataclasses.replace(walk, arrivals=walk.arrivals._replace(t=t, state=state))


def walk_cost(scene: Any, walk: "jb.Trajectory[Any]") -> JsonObject:
    """Cost of transport over the whole footsteps of a walk, ready for JSON; {} without any."""
    found = jb.measure.cost_of_transport(scene, walk)
    if not len(found.cost):
        return {}
    weight = float(scene.mechanism.total_mass) * float(scene.ground.g)
    motors, gravity = float(found.motor_work.sum()), float(found.gravity_work.sum())
    return {
        "cost_of_transport": (motors + gravity) / (weight * float(found.distance.sum())),
        "motor_work_J": motors,
    }


def cost_sentence(cost: JsonObject) -> str:
    return (
        f"cost of transport {cost['cost_of_transport']:.5f} over whole footsteps, with "
        f"{cost['motor_work_J']:.4g} J of the motors' positive work"
    )


def _constraint_numbers(scene: "jb.RedundantScene", walk: "jb.Trajectory[Any]") -> JsonObject:
    """Largest violations at the ends of the steps and what was corrected at the start (SI)."""
    off = jb.dynamics.violation(scene, walk.state)
    force = jb.dynamics.hip_force(scene, walk.state)
    correction = walk.correction
    return {
        "formulation": "redundant",
        "method": name_of(scene.method),
        "orientation": scene.orientation,
        "max_violation_m": float(np.max(off.position)),
        "max_violation_rate": float(np.max(off.rate)),
        "max_hip_force_N": float(np.max(np.hypot(force.x, force.z))),
        "start_correction_m": float(correction.position),
        "start_correction_m_s": float(correction.velocity),
    }

"""`jaxbiped continue`: follow the periodic gait along a parameter and print its bifurcations."""

import math
import time
from pathlib import Path

from jaxbiped._types import JsonObject
from jaxbiped.caching import _import_time
from jaxbiped.cli._report import Report, table
from jaxbiped.cli.commands._continue import ContinueGait
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import BranchPoint
from jaxbiped.continuation._continue_gait import continue_gait

_MOST_ROWS = 24
_STABLE = {True: "yes", False: "no", None: "undecided"}


def run(options: ContinueGait) -> int:
    """Runs the command; returns the exit code."""
    imported = time.perf_counter()
    scene = options.scene.scene()
    state = options.start.state(scene) if options.start.given else None
    options.output.check()
    branch = continue_gait(
        scene,  # type: ignore[arg-type]
        options.along,
        bounds=(options.first, options.last),
        guess=state,
        footsteps=options.footsteps,
        log=options.log,
        largest_step=options.largest_step,
        max_points=options.max_points,
        accuracy=options.accuracy,
        engine=options.engine,
        progress=True,
    )
    wall = {
        "import": imported - _import_time.IMPORT_BEGAN,
        "total": time.perf_counter() - _import_time.IMPORT_BEGAN,
    }
    report = Report(options.output.json)
    if len(branch):
        _print(report, branch, wall)
    else:
        report.say(branch.stops[0].cause)
    if len(branch) and options.output.out is not None:
        for path in write_results(branch, options.output.out):
            report.say(f"wrote {path}")
    report.finish(branch_numbers(branch) | {"wall_s": wall})
    return 0 if len(branch) else 1


def branch_numbers(branch: Branch) -> JsonObject:
    """What is known of a branch in SI units, ready for JSON."""
    return {
        "along": branch.along,
        "unit": branch.unit,
        "footsteps": branch.footsteps,
        "points": [_point(branch.along, each) for each in branch.points],
        "bifurcations": [
            {
                "kind": str(each.kind),
                "value": each.value,
                "multiplier": [each.multiplier.real, each.multiplier.imag],
                "error": each.error,
                "value_error": None if math.isnan(each.value_error) else each.value_error,
                "beyond": None if math.isnan(each.beyond) else each.beyond,
            }
            for each in branch.bifurcations
        ],
        "ends": [
            {
                "end": str(each.end),
                "cause": each.cause,
                "value": each.value if len(branch) else None,
            }
            for each in branch.stops
        ],
        "engine": branch.engine,
    }


def _point(along: str, each: BranchPoint) -> JsonObject:
    return {
        along: each.value,
        "value": each.value,
        "period_s": each.period,
        "step_length_m": each.step_length,
        "multipliers": [[value.real, value.imag] for value in each.multipliers.tolist()],
        "multiplier_errors": each.multiplier_errors.tolist(),
        "stable": each.stable,
    }


def write_results(branch: Branch, out: Path) -> list[Path]:
    """Writes the figures and the dataset of a branch; returns their paths."""
    from jaxbiped import plot

    figures = {
        "branch.png": plot.branch(branch, "step_length"),
        "spectral_radius.png": plot.branch(branch, "spectral_radius"),
    }
    for name, figure in figures.items():
        figure.savefig(out / name)
    branch.dataset().to_netcdf(out / "branch.nc")
    return [*(out / name for name in figures), out / "branch.nc"]


def _print(report: Report, branch: Branch, wall: dict[str, float]) -> None:
    head = (_with_unit(branch), "period s", "length m", "radius", "stable")
    rows = [
        (
            f"{each.value:.8g}",
            f"{each.period:.6f}",
            f"{each.step_length:.6f}",
            f"{abs(each.multipliers[0]):.6f}",
            _STABLE[each.stable],
        )
        for each in branch.points
    ]
    report.say(table(head, rows, most=_MOST_ROWS))
    report.say()
    if branch.bifurcations:
        report.say(_event_table(branch, branch.bifurcations))
    for where, stop in zip(("first", "last"), branch.stops, strict=True):
        report.say(f"{where} end at {branch.along} = {stop.value:.8g}: {stop.end} ({stop.cause})")
    report.say(f"{len(branch)} gaits; import {wall['import']:.1f} s, total {wall['total']:.1f} s")


def _event_table(branch: Branch, events: tuple[BifurcationPoint, ...]) -> str:
    head = ("bifurcation", _with_unit(branch), "error", "multiplier", "error")
    rows = [
        (
            str(each.kind),
            f"{each.value:.10g}",
            "–" if math.isnan(each.value_error) else f"{each.value_error:.1e}",
            _complex(each),
            f"{each.error:.1e}",
        )
        for each in events
    ]
    return table(head, rows, most=_MOST_ROWS)


def _complex(event: BifurcationPoint) -> str:
    value = event.multiplier
    if event.kind is BranchEvent.LIMIT or value.imag != 0.0:
        return f"{value.real:.6f} {value.imag:+.6f} i"
    return f"{value.real:.9f}"


def _with_unit(branch: Branch) -> str:
    return f"{branch.along} {branch.unit}".strip()

"""`jaxbiped continue`: follow the periodic gait along a parameter and print its bifurcations."""

import math
import time
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

import jaxbiped as jb
from jaxbiped._checks import ArgumentError, check_finite
from jaxbiped._files import JsonObject
from jaxbiped.cli import _options as options
from jaxbiped.cli._named_numbers import numbers_in, units_of
from jaxbiped.cli._report import Report, columns, records, table, wall_times
from jaxbiped.cli._scene_options import SceneOptions
from jaxbiped.cli._start_options import StartOptions

_MOST_ROWS = 24
_STABLE = {True: "yes", False: "no", None: "undecided"}


class ContinueGait(options.Command, of=("continue_gait",)):
    """Follow the periodic gait along a parameter; print its stability and its bifurcations."""

    scene: SceneOptions
    start: StartOptions
    output: options.OutputOptions
    along: str = "slope"
    """Name of the parameter."""
    first: Annotated[str, arg(name="from", metavar="FLOAT")] = "0.005"
    """Beginning of the range of the parameter, in SI units or with a unit, such as 1deg."""
    last: Annotated[str, arg(name="to", metavar="FLOAT")] = "0.1"
    """End of the range, in the same form."""
    footsteps: options.CycleFootsteps
    log: bool | None
    largest_step: Annotated[float, options.positive()]
    """Maximum arclength of a step, with the range scaled to length 1."""
    max_points: options.Count
    accuracy: options.GaitAccuracy
    engine: options.Engine

    def check_names(self, scene: SceneOptions) -> None:
        """Raises `ArgumentError` for a parameter that the scene lacks, or a range that is none."""
        self.bounds(scene.check_parameter("along", self.along))

    def bounds(self, unit: str | None) -> tuple[float, float]:
        """The range in SI units; raises `ArgumentError`."""
        first = numbers_in("from", self.along, self.first, unit)[0]
        last = numbers_in("to", self.along, self.last, unit)[0]
        check_finite("from", first)
        check_finite("to", last)
        if first == last:
            raise ArgumentError(f"from = to = {first:g} is not allowed: the range is empty.")
        return first, last

    def run(self) -> int:
        continue_gait, imported = jb.continue_gait, time.perf_counter()
        scene = self.scene.scene()
        guess = self.start.guess(scene, self.scene.walker)
        self.output.make_folder()
        branch = continue_gait(
            scene,  # type: ignore[arg-type]
            self.along,
            bounds=self.bounds(units_of(jb.parameter_quantities(scene)).get(self.along, "")),
            guess=guess,
            **self.arguments("continue_gait"),
        )
        report, wall = Report(self.output.json, self.output.csv), wall_times(imported)
        if len(branch):
            _print(report, branch, wall)
        else:
            report.say(branch.stops[0].cause)
        report.finish(branch_numbers(branch) | {"wall_s": wall}, branch.to_csv)
        if len(branch) and self.output.out is not None:
            report.wrote(write_results(branch, self.output))
        ends = [stop.end for stop in branch.stops]
        if jb.gait.BranchEnd.INTERRUPTED in ends:
            raise options.interrupted(
                f"the branch has the {len(branch)} gaits so far, and ends where it was left"
            )
        return int(not len(branch) or jb.gait.BranchEnd.UNFINISHED in ends)


def branch_numbers(branch: "jb.continuation.Branch") -> JsonObject:
    """What is known of a branch in SI units, for `strict_json`."""
    return {
        "along": branch.along,
        "unit": branch.unit,
        "footsteps": branch.footsteps,
        "points": [
            {
                branch.along: each.value,
                "value": each.value,
                "period_s": each.period,
                "step_length_m": each.step_length,
                "multipliers": each.multipliers,
                "multiplier_errors": each.multiplier_errors,
                "stable": each.stable,
            }
            for each in branch.points
        ],
        "bifurcations": [
            {name: x for name, x in records(each).items() if name != "point"}
            | {"value": each.value}
            for each in branch.bifurcations
        ],
        "ends": records(branch.stops),
        "engine": branch.engine,
    }


def write_results(branch: "jb.continuation.Branch", output: options.OutputOptions) -> list[Path]:
    """Writes the dataset and the figures of a branch; returns their paths."""
    assert output.out is not None
    data = output.out / "branch.nc"
    branch.to_dataset().to_netcdf(data)
    figures = {
        "branch": lambda: jb.plot.branch(branch),
        "spectral_radius": lambda: jb.plot.branch(branch, "spectral_radius"),
    }
    return [data, *output.draw(figures)]


def _print(report: Report, branch: "jb.continuation.Branch", wall: dict[str, float]) -> None:
    along = f"{branch.along} {branch.unit}".strip()
    layout = {
        along: "{0[0].value:.8g}",
        "period s": "{0[0].period:.6f}",
        "length m": "{0[0].step_length:.6f}",
        "radius": "{0[1]:.6f}",
        "stable": "{0[2]}",
    }
    rows = [(each, abs(each.multipliers[0]), _STABLE[each.stable]) for each in branch.points]
    report.say(columns(layout, rows, most=_MOST_ROWS), "")
    if branch.bifurcations:
        head, events = ("bifurcation", along, "error", "multiplier", "error"), []
        for each in branch.bifurcations:
            off = "–" if math.isnan(each.value_error) else f"{each.value_error:.1e}"
            at = str(each.kind), f"{each.value:.10g}", off
            events.append((*at, _multiplier(each), f"{each.error:.1e}"))
        report.say(table(head, events, most=_MOST_ROWS))
    for where, stop in zip(("first", "last"), branch.stops, strict=True):
        report.say(f"{where} end at {branch.along} = {stop.value:.8g}: {stop.end} ({stop.cause})")
    report.say(f"{len(branch)} gaits; import {wall['import']:.1f} s, total {wall['total']:.1f} s")


def _multiplier(event: "jb.continuation.BifurcationPoint") -> str:
    value = event.multiplier
    if event.kind is jb.continuation.BranchEvent.LIMIT or value.imag != 0.0:
        return f"{value.real:.6f} {value.imag:+.6f} i"
    return f"{value.real:.9f}"

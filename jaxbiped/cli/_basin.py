"""`jaxbiped basin`: what becomes of many starts."""

import json
import math
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxbiped._progress import stage
from jaxbiped._types import JsonObject
from jaxbiped.basins._fractions import fractions as fractions_of
from jaxbiped.basins._label_errors import LabelErrors, label_errors
from jaxbiped.basins._labels import Doubt, label_names
from jaxbiped.caching import _import_time
from jaxbiped.cli._report import Report, table
from jaxbiped.cli.commands._basin import Basin
from jaxbiped.dynamics._state import RigidState, State
from jaxbiped.scene._parameter_access import parameter_values
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.solve._accuracy import accuracy_told
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep._labelling_preparation import labelling
from jaxbiped.sweep._labelling_settings import effort_of
from jaxbiped.sweep._store_files import check_store
from jaxbiped.sweep._sweep import sweep
from jaxbiped.sweep.starts._coordinates import COORDINATES, coordinate_quantities
from jaxbiped.sweep.starts._starts import AbstractStarts, GivenStarts

if TYPE_CHECKING:
    import xarray

_MOST_ROWS = 64


def run(options: Basin) -> int:
    """Runs the command; returns the exit code."""
    scene = options.scene.scene()
    assert not isinstance(scene, RedundantScene)
    starts = options.starts.chosen(scene)
    how: dict[str, Any] = dict(
        footsteps=options.sweep.footsteps,
        accuracy=accuracy_told(options.sweep.accuracy),
        engine=options.sweep.engine,
    )
    effort = effort_of(scene, **how)
    options.output.check()
    if options.sweep.store is not None:
        check_store(options.sweep.store)
    executor, workers = options.sweep.executor()
    with stage("finding the gaits that starts are labelled by"):
        known = labelling(scene, parameters=starts.parameters, **how)
    began = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the report says it
            found = sweep(
                known,
                starts,
                store=options.sweep.store,
                any_version=options.sweep.any_version,
                chunk=options.sweep.chunk,
                executor=executor,
                workers=workers,
                progress=True,
            )
    finally:
        if executor is not None:
            executor.shutdown()
    seconds = time.perf_counter() - began
    numbers = basin_numbers(found, seconds) | {"engine": effort.engine}
    if isinstance(starts, GivenStarts):
        numbers["labels"] = _names(found).tolist()
    report = Report(options.output.json)
    _print(report, numbers)
    if options.output.out is not None:
        with stage("drawing the basin"):
            paths = _write_results(found, known, starts, options.output.out)
        for path in paths:
            report.say(f"wrote {path}")
    numbers["wall_s"] = time.perf_counter() - _import_time.IMPORT_BEGAN
    report.finish(numbers)
    return 0


def basin_numbers(found: "xarray.Dataset", seconds: float) -> JsonObject:
    """What is known of a basin in SI units, ready for JSON."""
    doubt = found.doubt.values == int(Doubt.REMAINS) if "doubt" in found else None
    fractions = fractions_of(_names(found), doubt=doubt)
    fresh = int(found.attrs["labelled_in_this_run"])
    gaits = [
        gait | {"parameters": row["parameters"]}
        for row in json.loads(found.attrs["gaits"])
        for gait in row["gaits"]
    ]
    return {
        "fractions": {name: [f.estimate, f.low, f.high] for name, f in fractions.items()},
        "counts": {name: f.count for name, f in fractions.items()},
        "starts": int(found.label.size),
        "labelled_in_this_run": fresh,
        "starts_per_s": fresh / seconds,
        "mean_footsteps": float(found.footsteps.mean()),
        "solver_steps": int(found.attempted.sum()),
        "gaits": gaits,
    } | ({"label_errors": label_errors(found).numbers()} if "doubt" in found else {})


def _names(found: "xarray.Dataset") -> np.ndarray:
    return label_names(found.label.values, found.cycle_footsteps.values)


def _print(report: Report, numbers: JsonObject) -> None:
    rows = [
        (name, str(numbers["counts"][name]), *(f"{100 * value:.2f}" for value in values))
        for name, values in numbers["fractions"].items()
    ]
    report.say(table(("label", "starts", "%", "from", "to"), rows, most=_MOST_ROWS))
    told = " and labels in doubt" if "label_errors" in numbers else ""
    report.say(f"from, to: 95 % interval by Wilson{told}")
    report.say()
    head = ("gait", "period s", "length m", "largest multiplier", "radius")
    rows = [
        (
            f"period-{gait['cycle_footsteps']}" + _at(gait["parameters"]),
            f"{gait['duration_s']:.6f}",
            f"{gait['step_length_m']:.6f}",
            f"{math.hypot(*gait['multipliers'][0]):.5f}",
            f"{gait['radius']:.3g}",
        )
        for gait in numbers["gaits"]
    ]
    report.say(table(head, rows, most=_MOST_ROWS) if rows else "no stable gait is known")
    report.say()
    report.say(
        f"{numbers['starts']} starts, {numbers['labelled_in_this_run']} of them labelled in this "
        f"run: {numbers['starts_per_s']:.0f} starts/s; {numbers['mean_footsteps']:.1f} footsteps "
        f"and {numbers['solver_steps'] / numbers['starts']:.0f} solver steps a start; "
        f"engine {numbers['engine']}"
    )
    if "label_errors" in numbers:
        report.say(LabelErrors(**numbers["label_errors"]).sentence())


def _at(parameters: dict[str, float]) -> str:
    return "".join(f", {name} {value:.4g}" for name, value in parameters.items())


def _write_results(
    found: "xarray.Dataset", known: Labelling, starts: AbstractStarts, out: Path
) -> list[Path]:
    """Writes the results, and the picture where there are two axes; returns the paths."""
    paths = [out / "basin.nc"]
    found.to_netcdf(paths[0])
    names = list(starts.axes)
    if len(names) == 2 and min(starts.shape) > 1:
        from jaxbiped import plot

        y, x = names
        quantities = coordinate_quantities(known.scene)
        figure = plot.basin(
            found.label.values,
            found[x].values,
            found[y].values,
            names=(quantities[x], quantities[y]),
            cycle_footsteps=found.cycle_footsteps.values,
            mark=_mark(known, x, y),
        )
        paths.append(out / "basin.png")
        figure.savefig(paths[1])
    return paths


def _mark(known: Labelling, x: str, y: str) -> tuple[float, float] | None:
    """Where the gait of the scene itself is in these coordinates, if it has one."""
    gaits = [gait for row in known.family.rows for gait in row]
    if known.family.names or not gaits:
        return None
    place = [_value(known.scene, gaits[0].state, name) for name in (x, y)]
    return place[0], place[1]


def _value(scene: Scene | RigidScene, state: State | RigidState, name: str) -> float:
    if name in COORDINATES:
        return float(getattr(state, COORDINATES[name]))
    return float(parameter_values(scene)[name])

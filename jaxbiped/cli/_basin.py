"""`jaxbiped basin`: what becomes of many starts."""

import json
import math
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import jaxbiped as jb
from jaxbiped._files import JsonObject
from jaxbiped._progress import stage
from jaxbiped.caching import IMPORT_BEGAN
from jaxbiped.cli import _options as options
from jaxbiped.cli._report import Report, columns
from jaxbiped.cli._scene_options import SceneOptions, minimal
from jaxbiped.cli._start_options import StartsOptions

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import numpy as np
    import xarray


_GAIT = {
    "gait": "{0[name]}",
    "period s": "{0[duration_s]:.6f}",
    "length m": "{0[step_length_m]:.6f}",
    "largest multiplier": "{0[largest]:.5f}",
    "radius": "{0[reach]}",
}
_MOST_UNFINISHED = 0.05
"""Share of starts without an outcome, above which the labels are not what was asked for."""
_REDUNDANT = (
    'formulation = "redundant" is not allowed for a basin: starts are labelled in minimal '
    "coordinates."
)


class SweepOptions(options.Options, of=("labelling", "sweep")):
    """How starts are followed, and where results are stored."""

    footsteps: options.Count
    """Maximum number of footsteps; a start that is still uncertain after them is unresolved."""
    accuracy: options.AnyAccuracy
    """How accurately to solve: draft, balanced or tight; or the fraction of the labels that may
    be wrong, such as 1e-4."""
    engine: options.Engine
    store: str | None
    """Zarr store for the results (a directory, or an address such as s3://bucket/basin.zarr), from
    which an interrupted run continues."""
    any_version: bool
    """Continue a store that another version or revision of jaxbiped wrote."""
    chunk: options.Count
    workers: options.Count = 1
    """Processes of this machine that share the work, each with its share of the cores."""
    scheduler: str | None = None
    """Address of a dask scheduler whose workers do the work."""

    def executor(self) -> "tuple[Executor | None, int]":
        """What runs the chunks, and how many at once; raises `ArgumentError`."""
        if self.scheduler is not None:
            return jb.cluster_executor(self.scheduler)
        return (None if self.workers == 1 else jb.local_executor(self.workers)), self.workers


class Basin(options.Command):
    """Label many starts: which walk on and in which gait, and how the others end."""

    scene: Annotated[SceneOptions, minimal(_REDUNDANT)]
    starts: StartsOptions
    sweep: SweepOptions
    output: options.OutputOptions

    def run(self) -> int:
        from jaxbiped.sweep._labelling_preparation import effort_of
        from jaxbiped.sweep._store_files import store_path

        scene: Any = self.scene.scene()
        starts = self.starts.chosen(scene)
        how = self.sweep.arguments("labelling")
        how["accuracy"] = options.accuracy_told(self.sweep.accuracy)
        effort = effort_of(scene, **how)
        self.output.make_folder()
        store_path(self.sweep.store)
        executor, workers = self.sweep.executor()
        with stage("finding the gaits that starts are labelled by"):
            known = jb.labelling(scene, parameters=starts.parameters, **how)
        began = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # the report says it
                found = jb.sweep(
                    known,
                    starts,
                    executor=executor,
                    **self.sweep.arguments("sweep") | {"workers": workers},
                )
        finally:
            if executor is not None:
                executor.shutdown()
        seconds = time.perf_counter() - began
        numbers = _basin_numbers(found, seconds) | {"engine": effort.engine}
        if isinstance(starts, jb.starts.GivenStarts):
            numbers["labels"] = _label_names(found)
        report = Report(self.output.json, self.output.csv)
        _print(report, numbers)
        numbers["wall_s"] = time.perf_counter() - IMPORT_BEGAN
        report.finish(numbers, lambda: jb.measure.to_csv(found, tuple(map(str, found.label.dims))))
        if self.output.out is not None:
            with stage("drawing the basin"):
                paths = _write_results(found, starts, self.output)
            report.wrote(paths)
        kinds = jb.basins.Label
        unfinished = (kinds.UNRESOLVED, kinds.OUT_OF_STEPS, kinds.SOLVER_FAILED)
        share = sum(numbers["counts"].get(str(kind), 0) for kind in unfinished) / numbers["starts"]
        met = "label_errors" not in numbers or numbers["label_errors"]["met"]
        return int(share > _MOST_UNFINISHED or not met)


def _basin_numbers(found: "xarray.Dataset", seconds: float) -> JsonObject:
    """What is known of a basin in SI units, ready for JSON."""
    remains = int(jb.basins.Doubt.REMAINS)
    doubt = found.doubt.values == remains if "doubt" in found else None
    fractions = jb.basins.fractions(_label_names(found), doubt=doubt)
    fresh = int(found.attrs["labelled_in_this_run"])
    gaits = [
        gait
        | {
            "parameters": row["parameters"],
            "radius": gait["radius"] if gait["radius"] > 0.0 else None,
        }
        for row in json.loads(found.attrs["gaits"])
        for gait in row["gaits"]
    ]
    numbers = {
        "fractions": {name: [f.estimate, f.low, f.high] for name, f in fractions.items()},
        "counts": {name: f.count for name, f in fractions.items()},
        "starts": int(found.label.size),
        "labelled_in_this_run": fresh,
        "starts_per_s": fresh / seconds,
        "mean_footsteps": float(found.footsteps.mean()),
        "solver_steps": int(found.attempted.sum()),
        "gaits": gaits,
    }
    if doubt is not None:
        numbers["label_errors"] = jb.basins.label_errors(found).numbers()
    return numbers


def _label_names(found: "xarray.Dataset") -> "np.ndarray":
    return jb.basins.label_names(found.label, found.cycle_footsteps.values)


def _print(report: Report, numbers: JsonObject) -> None:
    layout = {
        "label": "{0[0]}",
        "starts": "{0[1]}",
        "%": "{0[2]:.2f}",
        "from": "{0[3]:.2f}",
        "to": "{0[4]:.2f}",
    }
    rows = [
        (name, numbers["counts"][name], *(100.0 * value for value in values))
        for name, values in numbers["fractions"].items()
    ]
    told = " and labels in doubt" if "label_errors" in numbers else ""
    report.say(columns(layout, rows), f"from, to: 95 % interval by Wilson{told}", "")
    gaits = []
    for gait in numbers["gaits"]:
        at = "".join(f", {name} {value:.4g}" for name, value in gait["parameters"].items())
        name, largest = f"period-{gait['cycle_footsteps']}{at}", math.hypot(*gait["multipliers"][0])
        reach = "not known" if gait["radius"] is None else f"{gait['radius']:.3g}"
        gaits.append(gait | {"name": name, "largest": largest, "reach": reach})
    report.say(columns(_GAIT, gaits) if gaits else "no stable gait is known", "")
    report.say(
        f"{numbers['starts']} starts, {numbers['labelled_in_this_run']} of them labelled in this "
        f"run: {numbers['starts_per_s']:.0f} starts/s; {numbers['mean_footsteps']:.1f} footsteps "
        f"and {numbers['solver_steps'] / numbers['starts']:.0f} solver steps a start; "
        f"engine {numbers['engine']}"
    )
    if "label_errors" in numbers:
        report.say(jb.basins.LabelErrors(**numbers["label_errors"]).sentence())


def _write_results(
    found: "xarray.Dataset", starts: "jb.starts.AbstractStarts", output: options.OutputOptions
) -> list[Path]:
    """Writes the results, and the figure where there are two axes; returns the paths."""
    assert output.out is not None
    data = output.out / "basin.nc"
    found.to_netcdf(data)
    if len(starts.axes) != 2 or min(starts.shape) == 1:
        return [data]
    y, x = starts.axes
    return [data, *output.draw({"basin": lambda: jb.plot.basin(found, found[x], found[y])})]

"""Branch as a dataset in SI units, and back again."""

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped.continuation._axis import Axis
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import BranchPoint
from jaxbiped.continuation._trace import BranchStop
from jaxbiped.dynamics._bristle_state import BristleState
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.dynamics._state import State
from jaxbiped.dynamics._state_quantities import STATE_QUANTITIES
from jaxbiped.gait._continuation import BranchEnd
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.scene._parameters import parameter_values
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene

if TYPE_CHECKING:
    import xarray

_STATES = {kind.__name__: kind for kind in (State, BristleState, RigidState)}
_STABLE = {True: 1, False: 0, None: -1}
_NUMBERS = {
    "period": "s",
    "step_length": "m",
    "peak_normal": "N",
    "unit_multiplier_error": "",
    "residual": "SI",
}
_EVENTS = tuple(BranchEvent)


def branch_dataset(branch: Branch) -> "xarray.Dataset":
    """A branch as a dataset, ready for `to_netcdf` and `to_zarr`; see `open_branch`.

    Args:
        branch: from `continue_gait`.

    Returns:
        Along `point` the parameter, `state_…`, period, step_length, speed, peak_normal,
        multipliers with their errors, `stable` (1, 0, and −1 where the errors leave it open) and
        `bifurcation`, SI units; the special points' along `event`; all else in the attributes.
    """
    import xarray

    names = branch.state_type._fields[1:]  # type: ignore[attr-defined]
    units = {name: STATE_QUANTITIES[name].unit for name in names}
    variables = _columns(branch, branch.points, "", "point", units)
    kinds = [_EVENTS.index(each.kind) for each in branch.bifurcations]
    variables["event_kind"] = ("event", np.array(kinds, np.int8), _flags(_EVENTS, range(5)))
    special = [each.point for each in branch.bifurcations]
    variables |= _columns(branch, special, "event_", "event", units)
    multipliers = np.array([each.multiplier for each in branch.bifurcations], complex)
    variables["event_multiplier_real"] = ("event", multipliers.real, {"units": ""})
    variables["event_multiplier_imag"] = ("event", multipliers.imag, {"units": ""})
    errors = np.array([each.error for each in branch.bifurcations], float)
    variables["event_error"] = ("event", errors, {"units": ""})
    settings = {
        "along": branch.along,
        "axis": branch.axis._asdict(),
        "stops": [[int(each.end), each.cause, each.value] for each in branch.stops],
        "scene": {name: float(value) for name, value in parameter_values(branch.scene).items()},
        "state_type": branch.state_type.__name__,
        "footsteps": branch.footsteps,
        "accuracy": branch.accuracy,
        "engine": branch.engine,
    }
    return xarray.Dataset(variables, attrs={"branch": json.dumps(settings)})


def open_branch(dataset: "xarray.Dataset", scene: Scene | RigidScene) -> Branch:
    """The branch that a dataset holds, to be drawn, or followed on by `resume_branch`.

    Args:
        dataset: from `branch_dataset`, also one that was stored and opened again.
        scene: the walker that it was made with.

    Returns:
        The branch.

    Raises:
        ArgumentError: a dataset of something else, or of another scene.
    """
    check_type("scene", scene, Scene, RigidScene)
    if "branch" not in dataset.attrs:
        raise ArgumentError("dataset is not allowed: it must be one that branch_dataset made.")
    settings = json.loads(dataset.attrs["branch"])
    own = {name: float(value) for name, value in parameter_values(scene).items()}
    if own != settings["scene"]:
        kept = settings["scene"]
        names = sorted(name for name in own.keys() | kept.keys() if own.get(name) != kept.get(name))
        raise ArgumentError(
            f"scene is not allowed: it differs from the branch's own in {', '.join(names)}."
        )
    state_type = _STATES[settings["state_type"]]
    special = _points(dataset, state_type, settings["along"], "event_")
    events = [
        BifurcationPoint(_EVENTS[int(kind)], point, complex(real, imaginary), float(error))
        for kind, point, real, imaginary, error in zip(
            dataset["event_kind"].values,
            special,
            dataset["event_multiplier_real"].values,
            dataset["event_multiplier_imag"].values,
            dataset["event_error"].values,
            strict=True,
        )
    ]
    first, last = (BranchStop(BranchEnd(end), why, at) for end, why, at in settings["stops"])
    return Branch(
        scene=scene,
        points=tuple(_points(dataset, state_type, settings["along"], "")),
        bifurcations=tuple(events),
        stops=(first, last),
        axis=Axis(**settings["axis"]),
        state_type=state_type,
        footsteps=settings["footsteps"],
        accuracy=settings["accuracy"],
        engine=settings["engine"],
    )


def _flags(names: Any, codes: Any) -> dict[str, Any]:
    meanings = " ".join(str(name).replace(" ", "_") for name in names)
    return {"flag_values": [int(code) for code in codes], "flag_meanings": meanings}


def _columns(
    branch: Branch, points: Any, before: str, along: str, units: dict[str, str]
) -> dict[str, Any]:
    """Variables of points along a dimension."""
    m, n = len(units), len(points)

    def table(name: str, width: int, kind: type) -> np.ndarray:
        rows = [getattr(point, name) for point in points]
        return np.array(rows, kind).reshape(n, width)

    columns: dict[str, Any] = {
        branch.along: (along, [point.value for point in points], {"units": branch.unit}),
    }
    for name, unit in _NUMBERS.items():
        columns[name] = (along, [getattr(point, name) for point in points], {"units": unit})
    speeds = [point.step_length / point.period for point in points]
    columns["speed"] = (along, speeds, {"units": "m/s"})
    recurring = table("recurring", m, float)
    for k, (name, unit) in enumerate(units.items()):
        columns[f"state_{name}"] = (along, recurring[:, k], {"units": unit})
    values = table("multipliers", m - 1, complex)
    errors = table("multiplier_errors", m - 1, float)
    for name, array in (("real", values.real), ("imag", values.imag), ("error", errors)):
        columns[f"multipliers_{name}"] = ((along, "multiplier"), array, {"units": ""})
    stable = np.array([_STABLE[point.stable] for point in points], np.int8)
    words = ("undecided", "unstable", "stable")
    columns["stable"] = (along, stable, _flags(words, (-1, 0, 1)))
    codes = np.array([point.bifurcation for point in points], np.int8)
    columns["bifurcation"] = (along, codes, _flags(Bifurcation, Bifurcation))
    for name in ("place", "tangent"):
        columns[name] = ((along, "component"), table(name, m + 1, float), {"units": "scaled"})
    return {before + name: column for name, column in columns.items()}


def _points(
    dataset: "xarray.Dataset", state_type: Any, along: str, before: str
) -> list[BranchPoint]:
    def column(name: str) -> np.ndarray:
        return np.asarray(dataset[before + name].values)

    recurring = np.stack([column(f"state_{name}") for name in state_type._fields[1:]], axis=1)
    values = column("multipliers_real") + 1j * column("multipliers_imag")
    errors, codes = column("multipliers_error"), column("bifurcation")
    numbers = {name: column(name) for name in _NUMBERS}
    value, place, tangent = column(along), column("place"), column("tangent")
    return [
        BranchPoint(
            value=float(value[k]),
            recurring=recurring[k],
            multipliers=values[k],
            multiplier_errors=errors[k],
            bifurcation=int(codes[k]),
            place=place[k],
            tangent=tangent[k],
            **{name: float(numbers[name][k]) for name in _NUMBERS},
        )
        for k in range(len(value))
    ]

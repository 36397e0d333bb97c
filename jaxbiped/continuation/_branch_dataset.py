"""Branch as a dataset in SI units."""

from typing import TYPE_CHECKING, Any

import numpy as np

from jaxbiped._strict_json import strict_json
from jaxbiped.continuation._bifurcations import EVENTS
from jaxbiped.dynamics._state import STATE_QUANTITIES
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.scene._parameter_access import scene_identity

if TYPE_CHECKING:
    import xarray

    from jaxbiped.continuation._branch import Branch

_STABLE = {True: 1, False: 0, None: -1}
NUMBERS = {
    "period": "s",
    "step_length": "m",
    "peak_normal": "N",
    "unit_multiplier_error": "",
    "residual": "SI",
}


def branch_dataset(branch: "Branch") -> "xarray.Dataset":
    """A branch as a dataset; see `Branch.dataset`."""
    import xarray

    names = branch.state_type._fields[1:]  # type: ignore[attr-defined]
    units = {name: STATE_QUANTITIES[name].unit for name in names}
    variables = _columns(branch, branch.points, "", "point", units)
    kinds = [EVENTS.index(each.kind) for each in branch.bifurcations]
    variables["event_kind"] = (
        "event",
        np.array(kinds, np.int8),
        _flags(EVENTS, range(len(EVENTS))),
    )
    special = [each.point for each in branch.bifurcations]
    variables |= _columns(branch, special, "event_", "event", units)
    multipliers = np.array([each.multiplier for each in branch.bifurcations], complex)
    variables["event_multiplier_real"] = ("event", multipliers.real, {"units": ""})
    variables["event_multiplier_imag"] = ("event", multipliers.imag, {"units": ""})
    errors = np.array([each.error for each in branch.bifurcations], float)
    variables["event_error"] = ("event", errors, {"units": ""})
    offs = np.array([each.value_error for each in branch.bifurcations], float)
    variables["event_value_error"] = ("event", offs, {"units": branch.unit})
    beyond = np.array([each.beyond for each in branch.bifurcations], float)
    variables["event_beyond"] = ("event", beyond, {"units": branch.unit})
    settings = {
        "along": branch.along,
        "axis": branch.axis._asdict(),
        "stops": [[int(each.end), each.cause, each.value] for each in branch.stops],
        **scene_identity(branch.scene),
        "state_type": branch.state_type.__name__,
        "footsteps": branch.footsteps,
        "accuracy": branch.accuracy,
        "engine": branch.engine,
    }
    return xarray.Dataset(variables, attrs={"branch": strict_json(settings, unknown=str)})


def _flags(names: Any, codes: Any = None) -> dict[str, Any]:
    meanings = " ".join(str(name).replace(" ", "_") for name in names)
    codes = range(len(meanings.split())) if codes is None else codes
    return {"flag_values": list(codes), "flag_meanings": meanings}


def _columns(
    branch: "Branch", points: Any, before: str, along: str, units: dict[str, str]
) -> dict[str, Any]:
    """Variables of points along a dimension."""
    m, n = len(units), len(points)

    def table(name: str, width: int, kind: type) -> np.ndarray:
        rows = [getattr(point, name) for point in points]
        return np.array(rows, kind).reshape(n, width)

    columns: dict[str, Any] = {
        branch.along: (along, [point.value for point in points], {"units": branch.unit}),
    }
    for name, unit in NUMBERS.items():
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
    columns["bifurcation"] = (along, codes, _flags(Bifurcation))
    for name in ("place", "tangent"):
        columns[name] = ((along, "component"), table(name, m + 1, float), {"units": "scaled"})
    return {before + name: column for name, column in columns.items()}

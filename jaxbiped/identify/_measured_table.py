"""Table of measured gaits: CSV under a header with units, which are made SI units here."""

import csv
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped.identify._measured_gait import MEASURES, MeasuredAngles, MeasuredGait
from jaxbiped.scene._abstract_scene import AbstractScene
from jaxbiped.scene._parameter_access import parameter_quantities

_SCALES = {
    "s": {"s": 1.0, "ms": 1e-3},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6},
    "N": {"N": 1.0, "kN": 1e3},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "°": math.pi / 180.0},
    "kg": {"kg": 1.0, "g": 1e-3},
}
"""SI units, and how many of them each unit is."""
_UNITS = dict(zip(MEASURES, ("s", "m", "m/s", "N"), strict=True)) | {"time": "s"}
_BAR = "_error"
_PLAIN = ("gait", "footsteps", "since")
"""Columns without units."""
_HEADER = re.compile(r"(?P<name>[^\[\]()]*?)\s*(?:[\[(](?P<unit>.*)[\])])?")


class _Column(NamedTuple):
    """A column: its name, its header, and how many SI units one of its units is."""

    name: str
    header: str
    scale: float


def gaits_of_table(text: str, scene: AbstractScene | None) -> list[MeasuredGait]:
    """Measured gaits of a CSV file, whose conditions have the units of a scene's parameters.

    Raises:
        ArgumentError: a header or a cell that is not allowed.
    """
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip()]
    lines = [(k, line) for k, line in lines if not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise ArgumentError("file is not allowed: it must have a header and at least one row.")
    header, *rows = csv.reader(line for _, line in lines)
    units = {} if scene is None else _units_of(scene)
    columns = [_column(each.strip(), units) for each in header]
    names = [each.name for each in columns]
    for name in names:
        if names.count(name) > 1:
            raise ArgumentError(
                f"the column {name!r} is there {names.count(name)} times: give one."
            )
    groups: dict[Any, list[dict[str, Any]]] = {}
    for number, ((line, _), cells) in enumerate(zip(lines[1:], rows, strict=True)):
        if len(cells) != len(columns):
            raise ArgumentError(
                f"line {line} has {len(cells)} cells, and the header {len(columns)}: separate them "
                "by commas, and write numbers with a point."
            )
        row = {
            c.name: _value(c, cell.strip(), line) for c, cell in zip(columns, cells, strict=True)
        }
        label = row.get("gait", "time" in row or number)
        groups.setdefault(label, []).append(row)
    return [_gait(names, rows) for rows in groups.values()]


def _units_of(scene: AbstractScene) -> dict[str, str]:
    return {name: each.unit for name, each in parameter_quantities(scene).items()}


def _column(header: str, units: Mapping[str, str]) -> _Column:
    """A column by its header; of a condition the unit is that of the parameter, where known."""
    found = _HEADER.fullmatch(header)
    name, unit = (header, None) if found is None else (found["name"], found["unit"])
    if name in _PLAIN:
        return _Column(name, header, 1.0)
    stem = name.removesuffix(_BAR)
    angle = stem == "angle" or name.startswith("theta_")
    wanted = "rad" if angle else _UNITS.get(stem)
    if wanted is None:
        if units:
            check_choice("a column", name, (*_PLAIN, *_UNITS, "theta_BODY", *units))
        wanted = units.get(name)
    if unit is None:
        if wanted in ("", "1"):
            return _Column(name, header, 1.0)
        example = f"{name} [{wanted or 'rad'}]"
        raise ArgumentError(f"the column {header!r} names no unit: write it as {example!r}.")
    unit = "" if unit.strip() in ("1", "-", "–") else unit.strip()
    known = next((each for each in _SCALES.values() if unit in each), {unit: 1.0})
    allowed = known if wanted is None else _SCALES.get(wanted, {wanted: 1.0})
    if unit not in allowed:
        raise ArgumentError(
            f"the column {header!r} is not allowed: its unit must be one of {', '.join(allowed)}."
        )
    return _Column(name, header, allowed[unit])


def _value(column: _Column, cell: str, line: int) -> Any:
    """A cell in SI units; None for an empty one."""
    if not cell:
        return None
    if column.name in ("gait", "since"):
        return cell
    try:
        return int(cell) if column.name == "footsteps" else float(cell) * column.scale
    except ValueError:
        raise ArgumentError(
            f"line {line}: {column.header} = {cell!r} is not allowed: it must be a number."
        ) from None


def _gait(names: list[str], rows: list[dict[str, Any]]) -> MeasuredGait:
    angles = [name for name in names if name.startswith("theta_")]
    per_row = ["gait", "time", *angles]
    known = {name: _same(name, rows) for name in names if name not in per_row}
    measures = dict(_measures({n: x for n, x in known.items() if x is not None}))
    others = {"footsteps", "since", "angle_error", *MEASURES, *(f"{n}{_BAR}" for n in MEASURES)}
    conditions = {n: x for n, x in known.items() if n not in others and x is not None}
    seen = None
    if angles:
        if known.get("angle_error") is None or "time" not in names:
            raise ArgumentError("angles need the columns 'time [s]' and 'angle_error [rad]'.")
        columns = {name: _masked([row[name] for row in rows]) for name in ("time", *angles)}
        seen = MeasuredAngles(
            columns.pop("time"), known["angle_error"], since=known.get("since"), **columns
        )
    return MeasuredGait(measures, conditions, seen, known.get("footsteps"))


def _same(name: str, rows: list[dict[str, Any]]) -> Any:
    """What is said once of a gait; None where it is nowhere."""
    said = list(dict.fromkeys(row[name] for row in rows if row[name] is not None))
    if len(said) > 1:
        raise ArgumentError(
            f"{name} is {said[0]!r} and {said[1]!r} in rows of one gait: it must be one number; a "
            "column 'gait' tells gaits apart."
        )
    return said[0] if said else None


def _measures(known: Mapping[str, Any]) -> Iterator[tuple[str, tuple[float, float]]]:
    for name in MEASURES:
        if name in known:
            if f"{name}{_BAR}" not in known:
                raise ArgumentError(
                    f"{name} has no standard deviation: give it in a column "
                    f"'{name}{_BAR} [{_UNITS[name]}]'."
                )
            yield name, (known[name], known[f"{name}{_BAR}"])


def _masked(values: list[float | None]) -> Any:
    """Values of which some are missing."""
    missing = [each is None for each in values]
    return np.ma.array([0.0 if each is None else each for each in values], mask=missing)

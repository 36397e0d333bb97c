"""Measured gaits: what was observed of walkers, with standard deviations; and files of them."""

import dataclasses
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_finite,
    check_not_negative,
    check_positive,
    check_type,
    holds_somewhere,
)
from jaxbiped._files import read_csv, read_json
from jaxbiped._quantity import unit_scales
from jaxbiped._types import JsonObject
from jaxbiped.scene._parameter_access import parameter_quantities
from jaxbiped.scene._scene import AbstractScene

MEASURES = ("period", "step_length", "speed", "peak_normal")
"""Measures of a gait that may be given, as in `Measures`."""
OF_STATE = "state_"
"""What the name of a coordinate of the state on the section begins with, as a measure."""
CLOCKS = ("mid-stance", None)
_LONGEST = 20.0
"""Time beyond which milliseconds are suspected [s]."""
_UNITS = dict(zip(MEASURES, ("s", "m", "m/s", "N"), strict=True))
_KEYS = {f"{name}_{_UNITS[name].replace('/', '_')}": name for name in MEASURES}
_ANGLES = {"times_s": "times", "deviation_rad": "deviation", "since": "since"}
_ANGLE = re.compile(r"(theta_\w+)_rad")
_COLUMN_UNITS = _UNITS | {"time": "s"}
_BAR = "_error"
_PLAIN = ("gait", "footsteps", "since")
"""Columns without units."""
_HEADER = re.compile(r"(?P<name>[^\[\]()]*?)\s*(?:[\[(](?P<unit>.*)[\])])?")


@dataclasses.dataclass(frozen=True, init=False)
class MeasuredAngles:
    """Angles of bodies over time. Masked entries count as missing.

    Each angle belongs to one body throughout: of two legs, `theta_2` is that of the leg that stands
    at the beginning and swings in the next footstep.

    Args:
        times: see below.
        deviation: see below.
        theta_1, theta_2: angles of the legs of a walker with bodies "1" and "2".
        since: see below.
        **angles: angles of any bodies by their names in states, such as `theta_thigh_1`.

    Attributes:
        times: times on the data's own clock [s], shape (n,).
        deviation: standard deviation of every angle [rad].
        known: the angles by their names in states [rad], shape (n,) each.
        since: "mid-stance" if the clock reads zero at mid-stance of the leg that stands when a
            cycle begins, for any model. None: the clock is unknown, and its zero is fitted too.

    Raises:
        ArgumentError: a number or a shape is not allowed.
    """

    times: npt.ArrayLike
    deviation: float
    known: dict[str, npt.ArrayLike]
    since: str | None

    def __init__(
        self,
        times: npt.ArrayLike,
        deviation: float,
        theta_1: npt.ArrayLike | None = None,
        theta_2: npt.ArrayLike | None = None,
        since: str | None = None,
        **angles: npt.ArrayLike | None,
    ) -> None:
        given = {"theta_1": theta_1, "theta_2": theta_2} | angles
        known = {name: each for name, each in given.items() if each is not None}
        fields = {"times": times, "deviation": deviation, "known": known, "since": since}
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        self._check()

    def _check(self) -> None:
        check_not_negative("times", _as_array(self.times), "s")
        if not np.size(self.times):
            raise ArgumentError("times = [] is not allowed: give one at least.")
        _check_seconds("times", _as_array(self.times))
        check_positive("deviation", self.deviation, "rad")
        check_choice("since", self.since, CLOCKS)
        if not self.known:
            raise ArgumentError(
                "no angle is given, which is not allowed: give one of them at least, as theta_1."
            )
        for name, values in self.known.items():
            if not name.startswith("theta_"):
                raise ArgumentError(
                    f"{name} is not allowed: give angles of bodies by their names in states, as "
                    "theta_1."
                )
            if np.ndim(values) != 1 or np.shape(values) != np.shape(self.times):
                raise ArgumentError(
                    f"{name} has the shape {np.shape(values)}: it must be (n,), that of times, "
                    f"which is {np.shape(self.times)}."
                )
            check_finite(name, _as_array(values))
            if holds_somewhere(np.abs(_as_array(values)) > 2.0 * np.pi):
                raise ArgumentError(
                    f"{name} holds {np.max(np.abs(_as_array(values))):g}, which is beyond a whole "
                    "turn: it must be in radians; are these degrees?"
                )
        if not any(np.any(each) for each in self.seen.values()):
            raise ArgumentError(
                f"{' and '.join(self.known)} hold no angle that is known: give one."
            )

    @property
    def seen(self) -> dict[str, np.ndarray]:
        """Whether each angle is known at each time, by name (booleans), shape (n,)."""
        timed = ~np.ma.getmaskarray(np.ma.asarray(self.times))
        return {
            name: timed & ~np.ma.getmaskarray(np.ma.asarray(each))
            for name, each in self.known.items()
        }

    @property
    def values(self) -> np.ndarray:
        """The known angles, one body after the other."""
        return np.concatenate(
            [np.asarray(_as_array(self.known[n]))[at] for n, at in self.seen.items()]
        )


def _as_array(values: npt.ArrayLike) -> npt.ArrayLike:
    """Zeros where masked."""
    return np.ma.filled(values, 0.0) if isinstance(values, np.ma.MaskedArray) else values


def _check_seconds(name: str, values: npt.ArrayLike) -> None:
    seconds = np.asarray(_as_array(values), dtype=float)
    if holds_somewhere(seconds > _LONGEST):
        raise ArgumentError(
            f"{name} = {np.max(seconds):g} s is not allowed: it must be at most {_LONGEST:g} s; "
            "are these milliseconds?"
        )


@dataclasses.dataclass(frozen=True)
class MeasuredGait:
    """Observations of one steady gait.

    Attributes:
        measures: value and standard deviation of each measure by name (period [s], step_length [m],
            speed [m/s], peak_normal [N], or state_NAME for a coordinate of the state on the
            section); masked values count as missing.
        conditions: known parameters whose values differ from the scene's, by name, such as the
            slope.
        angles: angles of bodies over time, if any.
        footsteps: number of footsteps of a cycle; None for the smallest possible number.

    Raises:
        ArgumentError: a name is unknown, or a number is not allowed.

    Examples:
        >>> import jaxbiped as jb
        >>> gait = jb.identify.MeasuredGait({"period": (0.441, 1e-3)}, conditions={"slope": 0.02})
        >>> len(gait.values)
        1
    """

    measures: Mapping[str, tuple[float, float]]
    conditions: Mapping[str, float] = dataclasses.field(default_factory=dict)
    angles: MeasuredAngles | None = None
    footsteps: int | None = None

    def __post_init__(self) -> None:
        if self.footsteps is not None:
            check_count("footsteps", self.footsteps)
        check_type("measures", self.measures, Mapping)
        check_type("conditions", self.conditions, Mapping)
        known = {name: pair for name, pair in self.measures.items() if not _is_masked(pair)}
        object.__setattr__(self, "measures", known)
        for name, pair in self.measures.items():
            if not name.startswith(OF_STATE):
                check_choice("measures", name, (*MEASURES, f"{OF_STATE}COORDINATE"))
            if np.shape(pair) != (2,):
                raise ArgumentError(
                    f"measures[{name!r}] = {pair!r} is not allowed: give the value and its "
                    "standard deviation."
                )
            check_finite(f"measures[{name!r}]", pair[0])
            check_positive(f"the standard deviation of {name}", pair[1])
            if name == "period":
                _check_seconds(name, pair[0])
        if not self.measures and self.angles is None:
            raise ArgumentError("measures = {} is not allowed: give a measure or angles.")

    @property
    def values(self) -> np.ndarray:
        """All measured values, one after the other, shape (n,)."""
        angles: npt.ArrayLike = [] if self.angles is None else self.angles.values
        return np.concatenate([[value for value, _ in self.measures.values()], angles])

    @property
    def clocks(self) -> int:
        """Number of clocks whose zero is fitted: 1 if that of the angles is unknown."""
        return int(self.angles is not None and self.angles.since is None)

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations of the measured values, shape (n,)."""
        parts = [np.array([deviation for _, deviation in self.measures.values()])]
        if self.angles is not None:
            parts.append(np.full(len(self.angles.values), self.angles.deviation))
        return np.concatenate(parts)


def _is_masked(pair: object) -> bool:
    """Whether a value or its deviation is masked."""
    entries = pair if isinstance(pair, tuple | list | np.ndarray) else (pair,)
    return any(np.ma.is_masked(each) for each in (pair, *entries))


def read_measured(path: str | Path, scene: AbstractScene | None = None) -> list[MeasuredGait]:
    """Reads measured gaits from a JSON file, or from a CSV table whose header names units.

    A JSON file holds `{"gaits": [{"conditions": {"slope": 0.02}, "period_s": [0.441, 0.001],
    "step_length_m": …, "speed_m_s": …, "peak_normal_N": …, "angles": {"times_s": […],
    "theta_1_rad": […], "theta_2_rad": […], "deviation_rad": 0.001, "since": "mid-stance"},
    "footsteps": 1}, …]}`. Each measure has its value and its standard deviation, and the angle of a
    body NAME is "theta_NAME_rad". Leave out what was not measured; a single missing angle is null.

    A CSV file (`.csv`) has a row for each gait. Its columns are measures, their standard deviations
    under the same name with `_error`, and conditions under the names of parameters. The header
    gives units, among them s, ms, m, cm, mm, rad, deg, mrad, N and kN. Lines that begin with # are
    skipped::

        slope [deg],period [ms],period_error [ms],step_length [cm],step_length_error [cm]
        1.15,441.5,1,18.0,0.2

    Angles have a row for each time, with the columns `time` and `theta_BODY` for each body, and
    `angle_error` for the standard deviation of all angles. `since` and `footsteps` are columns
    without units. A value that is the same for the whole gait may be given once, in any row. If
    there are several such gaits, a column `gait` distinguishes their rows. An empty cell means "not
    measured".

    Args:
        path: path of the file.
        scene: the walker. The units of conditions in a CSV file are compared with those of its
            parameters; if it is omitted, they are not compared.

    Returns:
        The gaits, in the file's order.

    Raises:
        ArgumentError: the file cannot be read, is not JSON, or holds something else; in a table, a
            column has no unit, or a cell is not a number.
    """
    if Path(path).suffix.lower() == ".csv":
        return _gaits_of_table(read_csv("file", path), scene)
    held = read_json("file", path)
    gaits = held.get("gaits") if isinstance(held, dict) else None
    if not isinstance(gaits, list) or not gaits or not all(isinstance(g, dict) for g in gaits):
        raise ArgumentError(
            f'file = {str(path)!r} is not allowed: it must hold {{"gaits": [{{…}}, …]}}, at least '
            "one."
        )
    return [_gait_of_object(each) for each in gaits]


def _gait_of_object(held: JsonObject) -> MeasuredGait:
    measures: dict[str, Any] = {}
    options: dict[str, Any] = {}
    for key, value in held.items():
        if key in _KEYS:
            measures[_KEYS[key]] = tuple(value) if isinstance(value, list) else value
        elif key == "angles" and isinstance(value, dict):
            named = {key: found[1] for key in value if (found := _ANGLE.fullmatch(key))}
            _check_keys("angles", value, [*_ANGLES, *named, "theta_BODY_rad"])
            angles: dict[str, Any] = {
                name: _masked_array(value.get(own)) for own, name in (_ANGLES | named).items()
            }
            options["angles"] = MeasuredAngles(**angles)
        elif (key == "conditions" and isinstance(value, dict)) or key == "footsteps":
            options[key] = value
        else:
            _check_keys("a gait", [key], [*_KEYS, "angles", "conditions", "footsteps"])
            raise ArgumentError(f"{key} = {value!r} is not allowed: it must be an object.")
    return MeasuredGait(measures, **options)


def _masked_array(value: Any) -> Any:
    """A list with its nulls masked; anything else as it is."""
    if not isinstance(value, list) or None not in value:
        return value
    lost = [each is None for each in value]
    return np.ma.array([0.0 if each is None else each for each in value], mask=lost)


def _check_keys(where: str, keys: Iterable[str], allowed: Iterable[str]) -> None:
    for key in keys:
        if key not in allowed:
            names = ", ".join(allowed)
            raise ArgumentError(f"{key!r} is not known in {where}: choose from {names}.")


class _Column(NamedTuple):
    """A column: its name, its header, and how many SI units one of its units is."""

    name: str
    header: str
    scale: float


def _gaits_of_table(
    table: list[tuple[int, list[str]]], scene: AbstractScene | None
) -> list[MeasuredGait]:
    """Measured gaits of a CSV file, whose conditions have the units of a scene's parameters."""
    (_, header), *lines = table
    quantities = {} if scene is None else parameter_quantities(scene)
    units = {name: each.unit for name, each in quantities.items()}
    columns = [_column(cell, units) for cell in header]
    names = [each.name for each in columns]
    for name in names:
        if names.count(name) > 1:
            raise ArgumentError(
                f"the column {name!r} is there {names.count(name)} times: give one."
            )
    groups: dict[Any, list[tuple[int, dict[str, Any]]]] = {}
    for number, (line, cells) in enumerate(lines):
        row = {c.name: _value(c, cell, line) for c, cell in zip(columns, cells, strict=True)}
        label = row.get("gait", "time" in row or number)
        groups.setdefault(label, []).append((line, row))
    gaits = []
    for rows in groups.values():
        try:
            gaits.append(_gait_of_rows(names, [row for _, row in rows]))
        except ArgumentError as error:
            raise ArgumentError(f"line {rows[0][0]}: {error}") from None
    return gaits


def _column(header: str, units: Mapping[str, str]) -> _Column:
    """A column by its header; of a condition the unit is that of the parameter, where known."""
    found = _HEADER.fullmatch(header)
    name, unit = (header, None) if found is None else (found["name"], found["unit"])
    if name in _PLAIN:
        return _Column(name, header, 1.0)
    stem = name.removesuffix(_BAR)
    angle = stem == "angle" or name.startswith("theta_")
    wanted = "rad" if angle else _COLUMN_UNITS.get(stem)
    if wanted is None:
        if units:
            check_choice("a column", name, (*_PLAIN, *_COLUMN_UNITS, "theta_BODY", *units))
        wanted = units.get(name)
    if unit is None:
        if wanted in ("", "1"):
            return _Column(name, header, 1.0)
        example = f"{name} [{wanted or 'rad'}]"
        raise ArgumentError(f"the column {header!r} names no unit: write it as {example!r}.")
    unit = "" if unit.strip() in ("1", "-", "–") else unit.strip()
    allowed = unit_scales(wanted, unit)
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


def _gait_of_rows(names: list[str], rows: list[dict[str, Any]]) -> MeasuredGait:
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
        columns = {name: _masked_array([row[name] for row in rows]) for name in ("time", *angles)}
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
            "column 'gait' separates gaits."
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

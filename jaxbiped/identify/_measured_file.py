"""Files of measured gaits: JSON, or a table in CSV."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._files import read_json, read_text
from jaxbiped._types import JsonObject
from jaxbiped.identify._measured_gait import MEASURES, MeasuredAngles, MeasuredGait
from jaxbiped.identify._measured_table import gaits_of_table
from jaxbiped.scene._abstract_scene import AbstractScene

_UNITS = {"period": "s", "step_length": "m", "speed": "m_s", "peak_normal": "N"}
_KEYS = {f"{name}_{_UNITS[name]}": name for name in MEASURES}
_ANGLES = {"times_s": "times", "deviation_rad": "deviation", "since": "since"}
_ANGLE = re.compile(r"(theta_\w+)_rad")


def read_measured(path: str | Path, scene: AbstractScene | None = None) -> list[MeasuredGait]:
    """Reads measured gaits from a file of JSON, or from a CSV table whose header names units.

    A JSON file holds `{"gaits": [{"conditions": {"slope": 0.02}, "period_s": [0.441, 0.001],
    "step_length_m": …, "speed_m_s": …, "peak_normal_N": …, "angles": {"times_s": […],
    "theta_1_rad": […], "theta_2_rad": […], "deviation_rad": 0.001, "since": "mid-stance"},
    "footsteps": 1}, …]}`, the angle of a body NAME as "theta_NAME_rad": of each measure its value
    and its standard deviation; what was not measured is left out, single angles are null.

    A CSV file (`.csv`) has a row for each gait: measures, each with its standard deviation behind
    `_error`, and conditions by the names of parameters. Units stand in the header, s, ms, m, cm,
    mm, rad, deg, mrad, N and kN among them; lines that begin with # are skipped::

        slope [deg],period [ms],period_error [ms],step_length [cm],step_length_error [cm]
        1.15,441.5,1,18.0,0.2

    Angles have a row for each time: `time`, angles as `theta_BODY`, and `angle_error`, the standard
    deviation of them all, once; `since` and `footsteps` are columns without units. What is the
    same for the whole gait may be given once, in any row. Rows of several such gaits are told apart
    by a column `gait`. An empty cell was not measured.

    Args:
        path: of the file.
        scene: the walker, whose parameters' units those of conditions in a CSV file are compared
            with; not compared if omitted.

    Returns:
        The gaits, in the file's order.

    Raises:
        ArgumentError: a file that cannot be read, that is no JSON, or that holds something else;
            in a table a column without its unit, or a cell that is not a number.
    """
    if Path(path).suffix.lower() == ".csv":
        return gaits_of_table(read_text("file", path), scene)
    held = read_json("file", path)
    gaits = held.get("gaits") if isinstance(held, dict) else None
    if not isinstance(gaits, list) or not gaits or not all(isinstance(g, dict) for g in gaits):
        raise ArgumentError(
            f'file = {str(path)!r} is not allowed: it must hold {{"gaits": [{{…}}, …]}}, at least '
            "one."
        )
    return [_gait(each) for each in gaits]


def _gait(held: JsonObject) -> MeasuredGait:
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

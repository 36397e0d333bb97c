"""Measured gaits in a file."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._paths import read_json
from jaxbiped._types import JsonObject
from jaxbiped.identify._measured_gait import MEASURES, MeasuredAngles, MeasuredGait

_UNITS = {"period": "s", "step_length": "m", "speed": "m_s", "peak_normal": "N"}
_KEYS = {f"{name}_{_UNITS[name]}": name for name in MEASURES}
_ANGLES = {"times_s": "times", "theta_1_rad": "theta_1", "theta_2_rad": "theta_2"}
_ANGLES |= {"deviation_rad": "deviation", "since": "since"}


def read_measured(path: str | Path) -> list[MeasuredGait]:
    """Reads measured gaits from a JSON file.

    The file holds `{"gaits": [{"conditions": {"slope": 0.02}, "period_s": [0.441, 0.001],
    "step_length_m": …, "speed_m_s": …, "peak_normal_N": …, "angles": {"times_s": […],
    "theta_1_rad": […], "theta_2_rad": […], "deviation_rad": 0.001, "since": "mid-stance"},
    "footsteps": 1}, …]}`: of each measure its value and its standard deviation; what was not
    measured is left out, single angles are null.

    Args:
        path: of the file.

    Returns:
        The gaits, in the file's order.

    Raises:
        ArgumentError: a file that cannot be read, that is no JSON, or that holds something else.
    """
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
            _check_keys("angles", value, _ANGLES)
            angles: dict[str, Any] = {n: _masked(value.get(own)) for own, n in _ANGLES.items()}
            options["angles"] = MeasuredAngles(**angles)
        elif (key == "conditions" and isinstance(value, dict)) or key == "footsteps":
            options[key] = value
        else:
            _check_keys("a gait", [key], [*_KEYS, "angles", "conditions", "footsteps"])
            raise ArgumentError(f"{key} = {value!r} is not allowed: it must be an object.")
    return MeasuredGait(measures, **options)


def _masked(value: Any) -> Any:
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

"""Table of gaits: every number that is known of one, or of several, with its unit and its error."""

from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from jaxbiped._quantity import Quantity
from jaxbiped._tables import Entry
from jaxbiped.dynamics._state import recurring_names, state_quantity
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._homotopy import BranchEnd
from jaxbiped.gait._measures import QUANTITIES
from jaxbiped.gait._search_provenance import FoundBy

if TYPE_CHECKING:
    from jaxbiped.gait._gait import Gait


def gait_entries(gait: "Gait") -> dict[str, Entry]:
    """Variables of a dataset of a gait; NaN where none was found.

    Measures and the state on the section with their errors, multipliers along `multiplier`,
    sensitivities and elasticities along `parameter`. Arrays of several gaits keep their first axis,
    which the entries' dimensions leave out.
    """
    found = np.asarray(gait.ending) == int(Search.FOUND)
    entries: dict[str, Entry] = {}

    def known(value: npt.ArrayLike) -> np.ndarray:
        number = np.asarray(value, dtype=np.float64)
        own = found.reshape(found.shape + (1,) * (number.ndim - found.ndim))
        return np.where(own, number, np.nan)

    def add(name: str, value: Any, quantity: Quantity, error: Any = None, *own: str) -> None:
        entries[name] = Entry(own, known(value), quantity, None if error is None else known(error))

    codes: dict[str, tuple[Any, type[IntEnum]]] = {
        "ending": (gait.ending, Search),
        "found_by": (gait.origin.found_by, FoundBy),
        "branch_end": (gait.origin.branch_end, BranchEnd),
    }
    for name, (code, kind) in codes.items():
        flags = {int(each): str(each) for each in kind}
        words = Quantity(name.replace("_", " "))
        entries[name] = Entry((), np.asarray(code, dtype=np.int8), words, flags=flags)
    for name, quantity in QUANTITIES.items():
        add(name, getattr(gait.measures, name), quantity, getattr(gait.measure_errors, name))
    for name in recurring_names(gait.measures.state):
        quantity = state_quantity(name) or Quantity(name)
        value, error = (getattr(each.state, name) for each in (gait.measures, gait.measure_errors))
        add(f"state_{name}", value, quantity, error)
    parts = {"real": np.real(gait.multipliers), "imaginary": np.imag(gait.multipliers)}
    for name, part in parts.items():
        words = Quantity(f"multiplier, {name}")
        add(f"multiplier_{name[:4]}", part, words, gait.multiplier_errors, "multiplier")
    words = Quantity("error of the unit multiplier")
    add("unit_multiplier_error", gait.unit_multiplier_error, words)
    add("residual", gait.residual, Quantity("residual", "", "SI"))
    add("grazes", gait.grazes, Quantity("switches that are grazed"))
    for name, quantity in QUANTITIES.items():
        slope, slope_error, elasticity = (
            np.asarray(getattr(each, name))
            for each in (gait.sensitivities, gait.sensitivity_errors, gait.elasticities)
        )
        per = Quantity(
            f"sensitivity of the {quantity.words}",
            unit=f"{quantity.unit or 1} per unit of the parameter",
        )
        add(f"sensitivity_{name}", slope, per, slope_error, "parameter")
        with np.errstate(divide="ignore", invalid="ignore"):
            bar = np.where(slope == 0.0, 0.0, slope_error * np.abs(elasticity / slope))
        words = Quantity(f"elasticity of the {quantity.words}")
        add(f"elasticity_{name}", elasticity, words, bar, "parameter")
    return entries


def gait_coordinates(gait: "Gait") -> dict[str, Any]:
    """Coordinates of these: names of the parameters, and their SI units where they are known."""
    found: dict[str, Any] = {"parameter": np.array(gait.parameters, object)}
    if gait.quantities:
        units = np.array([each.unit for each in gait.quantities], object)
        found["parameter_unit"] = ("parameter", units)
    return found

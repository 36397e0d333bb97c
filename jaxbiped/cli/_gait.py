"""`jaxbiped gait`: find the periodic gait and print its stability and sensitivities."""

import math
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxbiped._types import JsonObject
from jaxbiped.caching import _import_time
from jaxbiped.cli._driven import cost_sentence, gait_cost
from jaxbiped.cli._report import Report, table
from jaxbiped.cli.commands._gait import FindGait
from jaxbiped.dynamics._rigid_checks import rigid_checks
from jaxbiped.dynamics._section import AbstractSection, HeelStrike, MidStance
from jaxbiped.gait._continuation import BranchEnd
from jaxbiped.gait._explain_search import explain_search
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait, Measures
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._accuracy import accuracy_told
from jaxbiped.solve._error_estimate import error_numbers, error_sentence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SECTIONS: dict[str, type[AbstractSection]] = {"mid-stance": MidStance, "heel-strike": HeelStrike}
_UNITS = {
    "period": "period_s",
    "step_length": "step_length_m",
    "speed": "speed_m_s",
    "peak_normal": "peak_normal_N",
    "spectral_radius": "spectral_radius",
}
"""Fields of `Measures` and their names with units."""
_MOST_ROWS = 64


def run(options: FindGait) -> int:
    """Runs the command; returns the exit code."""
    imported = time.perf_counter()
    scene = options.scene.scene()
    # A start that is not told is the search's own choice.
    state = options.start.state(scene) if options.start.given else None
    options.output.check()
    section = None if options.section is None else _SECTIONS[options.section]()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the table says it
        gait = find_gait(
            scene,
            state,
            footsteps=options.footsteps,
            section=section,
            accuracy=accuracy_told(options.accuracy),
            engine=options.engine,
        )
    found = gait.outcome is Search.FOUND  # waits for the result
    wall = {
        "import": imported - _import_time.IMPORT_BEGAN,
        "total": time.perf_counter() - _import_time.IMPORT_BEGAN,
    }
    numbers = gait_numbers(gait) | {"search": explain_search(scene, gait), "wall_s": wall}
    if gait.error is not None:
        numbers["error"] = error_numbers(gait.error)
    if found and isinstance(scene, RigidScene):
        numbers["assumptions"] = _assumptions(scene, gait)
    cost = gait_cost(scene, gait, options.footsteps) if found else {}
    numbers |= cost
    report = Report(options.output.json)
    if found:
        _print(report, numbers, gait)
        if "assumptions" in numbers:
            report.say(_assumption_line(numbers["assumptions"]))
        if cost:
            report.say(cost_sentence(cost))
    else:
        report.say(_failure(numbers, gait))
    if gait.error is not None:
        report.say(error_sentence(gait.error))
    if found and options.output.out is not None:
        for path in write_figures(gait, options.output.out):
            report.say(f"wrote {path}")
    report.finish(numbers)
    return 0 if found else 1


def write_figures(gait: Gait, out: Path) -> list[Path]:
    """Writes the figures of a gait; returns their paths."""
    from jaxbiped import plot

    figures: dict[str, Callable[[Gait], Figure]] = {
        "multipliers.png": plot.multipliers,
        "elasticities.png": plot.elasticities,
        "orbit.png": plot.gait_orbit,
    }
    for name, draw in figures.items():
        draw(gait).savefig(out / name)
    return [out / name for name in figures]


def gait_numbers(gait: Gait) -> JsonObject:
    """What is known of a gait in SI units, ready for JSON: None for what is not a finite number."""
    measures = gait.measures
    values = np.asarray(gait.multipliers).tolist()
    numbers = {
        "ending": str(gait.outcome),
        "period_s": float(measures.period),
        "step_length_m": float(measures.step_length),
        "speed_m_s": float(measures.speed),
        "peak_normal_N": float(measures.peak_normal),
        "state": {name: float(value) for name, value in measures.state._asdict().items()},
        "residual": float(gait.residual),
        "multipliers": [parts(value) for value in values],
        "multiplier_errors": np.asarray(gait.multiplier_errors).tolist(),
        "unit_multiplier_error": float(gait.unit_multiplier_error),
        "spectral_radius": float(measures.spectral_radius),
        "stable": gait.outcome is Search.FOUND and float(measures.spectral_radius) < 1.0,
        "bifurcation": str(gait.critical if gait.outcome is Search.FOUND else Bifurcation.NONE),
        "sensitivities": _by_parameter(gait.parameters, gait.sensitivities),
        "sensitivity_errors": _by_parameter(gait.parameters, gait.sensitivity_errors),
        "elasticities": _by_parameter(gait.parameters, gait.elasticities),
        "found_by": str(gait.found_by),
        "others": [
            {
                "period_s": other.period,
                "step_length_m": other.step_length,
                "spectral_radius": other.spectral_radius,
                "state": other.state._asdict(),
            }
            for other in gait.others
        ],
        "branch_end": str(BranchEnd(int(gait.origin.branch_end))),
        "walk_ending": str(gait.walk_outcome),
        "solver_steps": int(gait.solver_steps),
        "engine": gait.engine,
    }
    return finite(numbers)


def parts(value: complex) -> list[float]:
    """Real and imaginary part, both NaN where the number is not known."""
    return [value.real, value.imag] if np.isfinite(value) else [math.nan, math.nan]


def _by_parameter(parameters: tuple[str, ...], values: Measures) -> dict[str, dict[str, float]]:
    columns = {name: np.asarray(getattr(values, field)) for field, name in _UNITS.items()}
    columns |= {
        f"state.{name}": np.asarray(getattr(values.state, name)) for name in values.state._fields
    }
    return {
        parameter: {name: float(column[k]) for name, column in columns.items()}
        for k, parameter in enumerate(parameters)
    }


def finite(thing: Any) -> Any:
    """The same with None for every number that is not finite."""
    if isinstance(thing, dict):
        return {key: finite(value) for key, value in thing.items()}
    if isinstance(thing, list):
        return [finite(value) for value in thing]
    return None if isinstance(thing, float) and not math.isfinite(thing) else thing


def _assumptions(scene: RigidScene, gait: Gait) -> dict[str, float]:
    """What the gait asks of real feet: where it would slip, fly or scuff."""
    checks = rigid_checks(scene, gait.orbit[1])
    return {
        "needed_friction": float(np.max(np.asarray(checks.needed_friction))),
        "impact_friction": float(checks.impact_friction),
        "least_normal_N": float(np.min(np.asarray(checks.normal))),
        "lowest_clearance_m": float(np.min(np.asarray(checks.clearance))),
        "lifting_m_s": float(checks.lifting),
    }


def _assumption_line(known: dict[str, float]) -> str:
    flies = "would fly" if known["least_normal_N"] <= 0.0 else "stays down"
    held = "leaves the ground" if known["lifting_m_s"] >= 0.0 else "would be held by the ground"
    return (
        f"a real foot needs a friction coefficient of {known['needed_friction']:.3f} to roll and "
        f"{known['impact_friction']:.3f} at the impact; it {flies} (least force "
        f"{known['least_normal_N']:.2f} N); the trailing foot {held}; the swing foot's lowest "
        f"clearance is {1e3 * known['lowest_clearance_m']:.3f} mm"
    )


def _failure(numbers: JsonObject, gait: Gait) -> str:
    """One sentence on a search that found no gait."""
    residual, turns = numbers["residual"], int(gait.evaluations)
    returned = "no trial returned" if residual is None else f"residual {residual:.2e}"
    lost = "every trial walked on"
    if int(gait.walk_ending) != 0:
        lost = f"the last trial that did not return ended {numbers['walk_ending']!r}"
    best = ", ".join(
        f"{name} = {_format(value, '.6g')}" for name, value in numbers["state"].items()
    )
    return (
        f"{numbers['search']}; {numbers['ending']} after {turns} cycle{'s' * (turns != 1)}, "
        f"{returned}; {lost}; best state {best}"
    )


def _print(report: Report, numbers: JsonObject, gait: Gait) -> None:
    report.say(_gait_table(numbers, int(gait.evaluations)))
    report.say()
    report.say(_multiplier_table(numbers))
    report.say(
        "the multiplier that must be 1 is off by "
        + _format(numbers["unit_multiplier_error"], ".1e")
    )
    report.say(
        f"spectral radius {_format(numbers['spectral_radius'], '.6f')}: "
        + ("stable" if numbers["stable"] else "NOT STABLE")
    )
    report.say(numbers["search"])
    if gait.critical is not Bifurcation.NONE:
        report.say(f"AT A BIFURCATION: {gait.critical} (a multiplier lies on the unit circle)")
    report.say()
    report.say("elasticities, d log measure / d log parameter")
    report.say(_elasticity_table(numbers["elasticities"]))
    wall = numbers["wall_s"]
    report.say(f"import {wall['import']:.1f} s, total {wall['total']:.1f} s")


def _gait_table(numbers: JsonObject, turns: int) -> str:
    rows = [
        ("period s", _format(numbers["period_s"], ".7f")),
        ("step length m", _format(numbers["step_length_m"], ".7f")),
        ("speed m/s", _format(numbers["speed_m_s"], ".7f")),
        ("peak force N", _format(numbers["peak_normal_N"], ".3f")),
        ("residual", _format(numbers["residual"], ".1e")),
        ("cycles of search", str(turns)),
        ("solver steps", str(numbers["solver_steps"])),
        ("engine", numbers["engine"]),
    ]
    return table(("gait", "value"), rows, most=_MOST_ROWS)


def _multiplier_table(numbers: JsonObject) -> str:
    rows = []
    pairs = zip(numbers["multipliers"], numbers["multiplier_errors"], strict=True)
    for k, ((real, imaginary), error) in enumerate(pairs):
        size = None if real is None or imaginary is None else math.hypot(real, imaginary)
        shown = [_format(value, "z.6f") for value in (real, imaginary, size)]
        rows.append((str(k + 1), *shown, _format(error, ".1e")))
    return table(("multiplier", "real", "imaginary", "absolute", "error"), rows, most=_MOST_ROWS)


def _elasticity_table(elasticities: dict[str, dict[str, float | None]]) -> str:
    head = ("parameter", "period", "length", "speed", "peak", "radius")
    rows = [
        (parameter, *(_format(values[name], ".4g") for name in _UNITS.values()))
        for parameter, values in elasticities.items()
    ]
    return table(head, rows, most=_MOST_ROWS)


def _format(value: float | None, form: str) -> str:
    return "unknown" if value is None else format(value, form)

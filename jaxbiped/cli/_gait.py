"""`jaxbiped gait`: find the periodic gait and print its stability and sensitivities."""

import time
import warnings
from collections.abc import Callable
from typing import Annotated, Any

import jaxbiped as jb
from jaxbiped._files import JsonObject
from jaxbiped.cli import _options as options
from jaxbiped.cli._report import Report, columns, wall_times, words
from jaxbiped.cli._scene_options import SceneOptions
from jaxbiped.cli._start_options import StartOptions

_SECTIONS = {"mid-stance": "MidStance", "heel-strike": "HeelStrike"}
_UNITS = {
    "period": "period_s",
    "step_length": "step_length_m",
    "speed": "speed_m_s",
    "peak_normal": "peak_normal_N",
    "spectral_radius": "spectral_radius",
}
"""Fields of `Measures` and their names with units."""
_GAIT = {
    "period s": "{0[period_s]:.7f}",
    "step length m": "{0[step_length_m]:.7f}",
    "speed m/s": "{0[speed_m_s]:.7f}",
    "peak force N": "{0[peak_normal_N]:.3f}",
    "residual": "{0[residual]:.1e}",
    "cycles of search": "{0[cycles]}",
    "solver steps": "{0[solver_steps]}",
    "engine": "{0[engine]}",
}
_MULTIPLIER = {
    "multiplier": "{0[0]}",
    "real": "{0[1].real:z.6f}",
    "imaginary": "{0[1].imag:z.6f}",
    "absolute": "{0[2]:z.6f}",
    "error": "{0[3]:.1e}",
}
_ELASTICITY = {
    "parameter": "{0[parameter]}",
    "period": "{0[period_s]:.4g}",
    "length": "{0[step_length_m]:.4g}",
    "speed": "{0[speed_m_s]:.4g}",
    "peak": "{0[peak_normal_N]:.4g}",
    "radius": "{0[spectral_radius]:.4g}",
}


class FindGait(options.Command, of=("find_gait",)):
    """Find the periodic gait near a start; print its multipliers and its elasticities."""

    scene: SceneOptions
    start: StartOptions
    output: options.OutputOptions
    accuracy: options.Accuracy
    footsteps: options.CycleFootsteps
    section: Annotated[str | None, options.among(*_SECTIONS)]
    """Start of a cycle: mid-stance (default), or heel-strike (default for rigid walkers)."""
    engine: options.Engine

    def run(self) -> int:
        from jaxbiped.dynamics._energy import is_driven
        from jaxbiped.solve._error_estimate import error_numbers, error_sentence

        find_gait, imported = jb.find_gait, time.perf_counter()
        scene = self.scene.scene()
        guess = self.start.guess(scene, self.scene.walker)
        self.output.make_folder()
        section = None if self.section is None else getattr(jb, _SECTIONS[self.section])()
        how = self.arguments("find_gait")
        how |= {"section": section, "accuracy": options.accuracy_told(self.accuracy)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the table says it
            gait = find_gait(scene, guess, **how)
        found = gait.outcome is jb.gait.Search.FOUND  # waits for the result
        wall, search = wall_times(imported), jb.gait.explain_search(scene, gait)
        numbers = gait_numbers(gait) | {"search": search, "wall_s": wall}
        if gait.error is not None:
            numbers["error"] = error_numbers(gait.error)
        if found and isinstance(scene, jb.RigidScene):
            numbers["assumptions"] = _assumptions(scene, gait)
        if found and is_driven(scene):
            numbers |= _gait_cost(scene, gait)
        report = Report(self.output.json, self.output.csv)
        if found:
            _print(report, numbers, gait)
        else:
            report.say(_failure(numbers, gait))
        if gait.error is not None:
            report.say(error_sentence(gait.error))
        report.finish(numbers, gait.to_csv)
        if found:
            report.wrote(self.output.draw(gait_figures(gait)))
        return int(not found or (gait.error is not None and not gait.error.met))


def gait_figures(gait: "jb.Gait") -> dict[str, Callable[[], Any]]:
    """What draws the figures of a gait, by the names of their files."""
    return {
        "multipliers": lambda: jb.plot.multipliers(gait),
        "elasticities": lambda: jb.plot.elasticities(gait),
        "orbit": lambda: jb.plot.gait_orbit(gait),
    }


def gait_numbers(gait: "jb.Gait") -> JsonObject:
    """What is known of a gait in SI units, for `strict_json`."""
    measures, found = gait.measures, gait.outcome is jb.gait.Search.FOUND
    return {
        "ending": str(gait.outcome),
        **{name: float(getattr(measures, field)) for field, name in _UNITS.items()},
        "state": {name: float(value) for name, value in measures.state._asdict().items()},
        "residual": float(gait.residual),
        "multipliers": gait.multipliers,
        "multiplier_errors": gait.multiplier_errors,
        "unit_multiplier_error": float(gait.unit_multiplier_error),
        "stable": found and float(measures.spectral_radius) < 1.0,
        "bifurcation": str(gait.critical if found else jb.gait.Bifurcation.NONE),
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
        "branch_end": str(jb.gait.BranchEnd(int(gait.origin.branch_end))),
        "walk_ending": str(gait.walk_outcome),
        "solver_steps": int(gait.solver_steps),
        "engine": gait.engine,
    }


def _by_parameter(
    parameters: tuple[str, ...], values: "jb.gait.Measures"
) -> dict[str, dict[str, float]]:
    found = {name: getattr(values, field).tolist() for field, name in _UNITS.items()}
    found |= {f"state.{name}": each.tolist() for name, each in values.state._asdict().items()}
    rows = zip(*found.values(), strict=True)
    return {
        name: dict(zip(found, row, strict=True)) for name, row in zip(parameters, rows, strict=True)
    }


def _gait_cost(scene: Any, gait: "jb.Gait") -> JsonObject:
    """Cost of transport over a cycle of a driven gait, ready for JSON.

    A cycle that begins between heel strikes is counted from the first of them.
    """
    from jaxbiped.cli._walk_report import walk_cost

    modelled, state, most = scene.minimal, gait.measures.state, len(gait.step_lengths) + 1
    walk: jb.Trajectory[Any]
    if isinstance(modelled, jb.RigidScene):
        walk = jb.rigid_walk(modelled, state, footsteps=most, max_arrivals=most, accuracy="tight")
    else:
        walk = jb.simulate(modelled, state, footsteps=most)
    return walk_cost(modelled, walk)


def _assumptions(scene: "jb.RigidScene", gait: "jb.Gait") -> dict[str, float]:
    """What the gait asks of real feet: where it would slip, fly or scuff."""
    checks = jb.dynamics.rigid_checks(scene, gait.orbit[1])
    return {
        "needed_friction": float(checks.needed_friction.max()),
        "impact_friction": float(checks.impact_friction),
        "least_normal_N": float(checks.normal.min()),
        "lowest_clearance_m": float(checks.clearance.min()),
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


def _failure(numbers: JsonObject, gait: "jb.Gait") -> str:
    """One sentence on a search that found no gait."""
    turns = int(gait.evaluations)
    returned = words("residual {0:.2e}", numbers["residual"])
    if "unknown" in returned:
        returned = "no trial returned"
    lost = "every trial walked on"
    if int(gait.walk_ending) != 0:
        lost = f"the last trial that did not return ended {numbers['walk_ending']!r}"
    best = ", ".join(words("{0[0]} = {0[1]:.6g}", each) for each in numbers["state"].items())
    return (
        f"{numbers['search']}; {numbers['ending']} after {turns} cycle{'s' * (turns != 1)}, "
        f"{returned}; {lost}; best state {best}"
    )


def _print(report: Report, numbers: JsonObject, gait: "jb.Gait") -> None:
    import numpy as np

    from jaxbiped.cli._walk_report import cost_sentence

    shown = numbers | {"cycles": int(gait.evaluations)}
    rows = [(name, words(text, shown)) for name, text in _GAIT.items()]
    report.say(columns({"gait": "{0[0]}", "value": "{0[1]}"}, rows), "")
    values = np.asarray(gait.multipliers)
    values = np.where(np.isfinite(values), values, complex(np.nan, np.nan))
    errors = np.asarray(gait.multiplier_errors)
    numbered = zip(range(1, len(values) + 1), values, np.abs(values), errors, strict=True)
    report.say(
        columns(_MULTIPLIER, numbered),
        words("the multiplier that must be 1 is off by {0[unit_multiplier_error]:.1e}", numbers),
        words("spectral radius {0[spectral_radius]:.6f}: ", numbers)
        + ("stable" if numbers["stable"] else "NOT STABLE"),
        numbers["search"],
    )
    if gait.critical is not jb.gait.Bifurcation.NONE:
        where = "a multiplier lies within its error of the unit circle"
        report.say(f"AT A BIFURCATION: {gait.critical} ({where})")
    elasticities = [{"parameter": name} | row for name, row in numbers["elasticities"].items()]
    report.say(
        "",
        "elasticities, d log measure / d log parameter",
        columns(_ELASTICITY, elasticities),
        words("import {0[import]:.1f} s, total {0[total]:.1f} s", numbers["wall_s"]),
    )
    if "assumptions" in numbers:
        report.say(_assumption_line(numbers["assumptions"]))
    if "cost_of_transport" in numbers:
        report.say(cost_sentence(numbers))

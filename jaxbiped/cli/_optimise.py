"""`jaxbiped optimise`: the parameters within bounds whose gait is best, and what certifies it."""

import dataclasses
import math
import sys

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._types import JsonObject
from jaxbiped.cli._gait import finite, parts
from jaxbiped.cli._report import Report, table
from jaxbiped.cli.commands._optimise import Optimise
from jaxbiped.continuation._nearest_bifurcation import (
    NearestBifurcation,
    farthest_allowed,
    range_of,
)
from jaxbiped.optimise._certificate import Certificate, certify
from jaxbiped.optimise._objectives import OBJECTIVES
from jaxbiped.optimise._optimise_gait import optimise_gait
from jaxbiped.optimise._optimum import Optimum
from jaxbiped.optimise._runs import Outcome
from jaxbiped.scene._parameter_access import parameter_names, parameter_quantities, parameter_values
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene

_USUAL_RANGE = 2.0
"""Factor to both sides of a parameter's own value that it varies by unless bounds are given."""
_MOST_ROWS = 64


def run(options: Optimise) -> int:
    """Runs the command; returns the exit code."""
    scene = options.scene.scene()
    assert not isinstance(scene, RedundantScene)
    along = [n.strip() for n in options.bifurcations.split(",") if n.strip() not in ("", "none")]
    for name in along:
        check_choice("bifurcations", name, parameter_names(scene))
        range_of(scene, name)
    found = optimise_gait(
        scene,
        vary=_bounds(scene, options.vary),
        maximise=options.maximise,
        minimise=options.minimise,
        subject_to=options.subject_to or None,
        optimiser=options.optimiser,
        iterations=options.iterations,
        restarts=options.restarts,
        seed=options.seed,
        accuracy=options.accuracy,
        engine=options.engine,
        progress=sys.stderr.isatty(),
        store=options.store,
    )
    certificate = certify(
        found,
        starts=options.basin,
        footsteps=options.footsteps,
        fatal_push=options.fatal_push,
        bifurcations_along=along,
        other_engine=options.other_engine,
        progress=sys.stderr.isatty(),
    )
    goal = options.minimise if options.maximise is None else options.maximise
    sense = "minimise" if options.maximise is None else "maximise"
    assert goal is not None
    numbers = optimum_numbers(found, certificate, goal, sense)
    report = Report(options.json)
    _print(report, scene, found, certificate, goal)
    report.finish(numbers)
    ended = (Outcome.CONVERGED, Outcome.CORNER, Outcome.BEYOND_RANGE)
    return 0 if found.outcome in ended else 1


def _bounds(scene: Scene | RigidScene, text: str) -> dict[str, tuple[float, float]]:
    """Bounds by name from d=0.05:0.2,r,J."""
    own, found = parameter_values(scene), {}
    for part in text.split(","):
        name, given, bounds = (each.strip() for each in part.partition("="))
        check_choice("vary", name, parameter_names(scene))
        if not given:
            value = float(own[name])
            if value <= 0.0:
                raise ArgumentError(
                    f"vary = {name} needs bounds, as its value is {value:g}: write {name}=low:high."
                )
            ends = (value / _USUAL_RANGE, value * _USUAL_RANGE)
            least, most = (farthest_allowed(scene, name, end) for end in ends)
            found[name] = (least, most)
            continue
        low, colon, high = bounds.partition(":")
        try:
            if not colon:
                raise ValueError
            found[name] = (float(low), float(high))
        except ValueError:
            raise ArgumentError(
                f"vary = {part.strip()!r} is not understood: write {name}=low:high."
            ) from None
    return found


def optimum_numbers(found: Optimum, certificate: Certificate, goal: str, sense: str) -> JsonObject:
    """What is known of an optimum in SI units, ready for JSON."""
    numbers: JsonObject = {
        "outcome": str(found.outcome),
        "message": found.message,
        "variables": found.variables,
        "objective": {
            "name": goal,
            "sense": sense,
            "value": found.objective,
            "error": found.error,
            "unit": OBJECTIVES[goal].quantity.unit,
        },
        "measures": {
            name: {
                "value": value,
                "error": found.known.errors[name],
                "beyond_range": name in found.known.beyond_range,
            }
            for name, value in found.known.values.items()
        },
        "history": [each._asdict() for each in found.history],
        "evaluations": found.evaluations,
        "lost": found.lost,
        "unmeasured": found.unmeasured,
        "certificate": certificate_numbers(certificate),
    }
    checked: JsonObject = finite(numbers)
    return checked


def certificate_numbers(certificate: Certificate) -> JsonObject:
    """A certificate, ready for JSON."""
    told, (norm, norm_error) = certificate.optimality, certificate.sensitivity_norm
    basin, walk = certificate.basin, certificate.walk
    other, push = certificate.other_engine, certificate.fatal_push
    return {
        "kkt_residual": told.residual,
        "kkt_residual_error": told.error,
        "excess": told.excess,
        "constraints": [each._asdict() for each in told.requirements],
        "bounds": [each._asdict() for each in told.bounds],
        "multipliers": [parts(value) for value in certificate.multipliers.tolist()],
        "multiplier_errors": np.asarray(certificate.multiplier_errors).tolist(),
        "unit_multiplier_error": certificate.unit_multiplier_error,
        "stable": certificate.stable,
        "sensitivity_norm": {"value": norm, "error": norm_error},
        "basin": None if basin is None else dataclasses.asdict(basin),
        "fatal_push": push and {"distance": push.distance, "push": push.push.tolist()},
        "walk": None if walk is None else walk._asdict(),
        "other_engine": None if other is None else other._asdict(),
        "nearest_bifurcations": [
            {
                "along": each.along,
                "kind": None if each.kind is None else str(each.kind),
                "value": each.value,
                "ratio": each.ratio,
                "multiplier": parts(each.multiplier),
                "error": each.error,
            }
            for each in certificate.nearest_bifurcations
        ],
        "failed": certificate.failed,
    }


def _print(
    report: Report,
    scene: Scene | RigidScene,
    found: Optimum,
    certificate: Certificate,
    goal: str,
) -> None:
    units, own = parameter_quantities(scene), parameter_values(scene)
    rows = [
        (name, f"{float(own[name]):.6g}", f"{value:.6g}", units[name].unit_in_text)
        for name, value in found.variables.items()
    ]
    report.say(table(("variable", "began", "best", "unit"), rows, most=_MOST_ROWS))
    report.say()
    first = found.history[0].measures if found.history else {}
    measures = [
        (
            name,
            f"{first[name]:.6g}" if name in first else "–",
            *_told(found, name, value),
            OBJECTIVES[name].quantity.unit_in_text,
        )
        for name, value in found.known.values.items()
        if name in OBJECTIVES
    ]
    report.say(table(("measure", "began", "best", "error", "unit"), measures, most=_MOST_ROWS))
    report.say()
    report.say(
        f"{goal} {found.objective:.6g}, {found.outcome} after {len(found.history)} iterations and "
        f"{found.evaluations} gaits ({found.message})"
    )
    for line in _certificate_lines(certificate):
        report.say(line)


def _told(found: Optimum, name: str, value: float) -> tuple[str, str]:
    """A measure and its error, or more than what a range holds."""
    if name in found.known.beyond_range:
        return f"> {value:.6g}", "–"
    return f"{value:.6g}", f"{found.known.errors[name]:.1e}"


def _bifurcation_line(nearest: NearestBifurcation) -> str:
    if nearest.kind is None:
        return f"no bifurcation along {nearest.along} in the range that was followed"
    times = "" if math.isnan(nearest.ratio) else f" ({nearest.ratio:.3g} times its value)"
    return f"along {nearest.along} the nearest is {nearest.kind} at {nearest.value:.6g}{times}"


def _certificate_lines(certificate: Certificate) -> list[str]:
    told = certificate.optimality
    lines = [
        f"optimality: residual {told.residual:.1e}, requirements missed by {told.excess:.1e}",
        *(
            f"held by {each.name} at {each.bound:.6g}: multiplier {each.multiplier:.4g} ± "
            f"{each.multiplier_error:.1e}"
            for each in (*told.requirements, *told.bounds)
            if each.active
        ),
        f"multipliers: {_sizes(certificate)}; the one that must be 1 is off by "
        f"{certificate.unit_multiplier_error:.1e}; {_STABLE[certificate.stable]}",
        "sensitivity norm {:.4g} ± {:.1e}".format(*certificate.sensitivity_norm),
    ]
    basin, walk, other = certificate.basin, certificate.walk, certificate.other_engine
    if basin is not None:
        lines.append(
            f"basin: {basin.estimate:.3f} of the starts about the gait ({basin.low:.3f} to "
            f"{basin.high:.3f})"
        )
    if certificate.fatal_push is not None:
        lines.append(f"smallest fatal push seen: {certificate.fatal_push.distance:.4f} (scaled)")
    if walk is not None:
        back = "back to the gait" if walk.returned else "NOT back to the gait"
        lines.append(f"walk from a push of {walk.push:g}: {walk.footsteps} footsteps, {back}")
    lines += [_bifurcation_line(each) for each in certificate.nearest_bifurcations]
    lines += [f"{name}: not known ({why})" for name, why in certificate.failed.items()]
    if other is not None:
        lines.append(
            f"engine {other.engine}: period differs by {other.period_difference:.1e}, length by "
            f"{other.length_difference:.1e}, spectral radius by {other.radius_difference:.1e}"
        )
    return lines


_STABLE = {True: "stable", False: "NOT STABLE", None: "undecided within the error"}


def _sizes(certificate: Certificate) -> str:
    pairs = zip(np.abs(certificate.multipliers), certificate.multiplier_errors, strict=True)
    return ", ".join(f"{size:.4f} ± {error:.0e}" for size, error in list(pairs)[:3])

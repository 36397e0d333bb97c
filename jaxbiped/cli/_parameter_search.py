"""Searches for parameters: `jaxbiped optimise` for the best gait, `fit` for the measured ones."""

import dataclasses
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional

import jaxbiped as jb
from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._files import JsonObject, read_json, read_text
from jaxbiped.cli import _options as options
from jaxbiped.cli._declarations import names
from jaxbiped.cli._gait import gait_figures
from jaxbiped.cli._named_numbers import numbers_in, parse_axis, units_of
from jaxbiped.cli._report import Report, columns, records
from jaxbiped.cli._scene_options import SceneOptions, minimal

_MEASURE = re.compile(r"\s*(\w+)")
_TESTS = ("footsteps", "fatal_push", "other_engine")
"""Options of the certificate under its own names."""
_USUAL_RANGE = (0.5, 2.0)
"""Factors of a parameter's own value between which it varies unless bounds are given."""
_STABLE = {True: "stable", False: "NOT STABLE", None: "undecided within the error"}
_REDUNDANT = (
    "formulation = redundant is not allowed here: how the hip is held makes no difference to a "
    "gait; choose minimal."
)
_ESTIMATE = {
    "parameter": "{0[0]}",
    "unit": "{0[1].unit}",
    "estimate": "{0[2]:.6g}",
    "standard error": "{0[3]:.6g}",
    "95 % from": "{0[4][0]:.6g}",
    "to": "{0[4][1]:.6g}",
}
_FRONT = {
    "bound": "{0[bound]:.6g}",
    "objective": "{0[objective]:.6g}",
    "error": "{0[error]:.1e}",
    "slope": "{0[slope]:.4g}",
    "slope's error": "{0[slope_error]:.1e}",
    "outcome": "{0[outcome]}",
}
_SENSITIVITY = {
    "fixed number": "{0[parameter]}",
    "d objective": "{0[objective]:.6g}",
    "error": "{0[objective_error]:.1e}",
}
_REDUNDANT_FIT = 'formulation = "redundant" is not allowed here: it must be "minimal".'
_IS_MEASURED = options.Check(
    lambda name, path: (read_text if path.suffix.lower() == ".csv" else read_json)(name, path)
)


class Optimise(options.Command, of=("optimise.certify", "optimise_gait")):
    """Find the parameters within bounds whose periodic gait is best, and certify it."""

    vary: str
    """Parameters to vary: d,r,J (from half to double their values), or with bounds d=0.05:0.2,r."""
    scene: Annotated[SceneOptions, minimal(_REDUNDANT)]
    maximise: str | None = None
    """Measure of the gait to maximise, such as speed."""
    minimise: str | None = None
    """Measure of the gait to minimise, such as spectral_radius."""
    subject_to: tuple[str, ...] = ()
    """Requirements, such as "spectral_radius<0.4" "step_length>0.2"."""
    front: str | None = None
    """Also the best designs under several bounds on a measure: speed>0.4:0.6:5 for five of them."""
    search: Annotated[str | None, options.one_of("optimise.FORMULATIONS")] = None
    """How a design and its gait are sought: gait by gait, or together, as one problem."""
    segments: options.Count
    """Number of segments of the cycle that are sought together."""
    optimiser: Annotated[str, options.one_of("optimise.OPTIMISERS")]
    """Optimiser: trust-region, slsqp, trust-constr; or, without requirements, optax."""
    iterations: options.Count
    """Maximum number of iterations of a run."""
    restarts: options.NotNegative
    """Number of further runs, from the best of scattered designs."""
    seed: int
    """Random seed for scattering these designs."""
    accuracy: options.GaitAccuracy
    engine: options.Engine
    basin: options.NotNegative = 1024
    """Number of starts around the gait that the certificate labels; 0 for none."""
    footsteps: options.NotNegative
    """Number of footsteps that the certificate walks from a pushed start; 0 for none."""
    bifurcations: str = "slope"
    """Parameters along which the certificate seeks the nearest bifurcation: slope,d; or none."""
    fatal_push: bool
    other_engine: bool
    store: Path | None
    output: options.OutputOptions

    def check_names(self, scene: SceneOptions) -> None:
        """Raises `ArgumentError` for parameters and measures that the scene lacks."""
        for name, bounds in _parts(self.vary).items():
            unit = scene.check_parameter("vary", name)
            if bounds:
                numbers_in("vary", name, bounds, unit, ":", 2)
        for name in _parts(self.bifurcations):
            scene.check_parameter("bifurcations", name)
        goals = {"maximise": (self.maximise,), "minimise": (self.minimise,)}
        if self.front is not None:
            goals["front"] = (_front_axis(self.front)[0],)
        for option, texts in (goals | {"subject_to": self.subject_to}).items():
            for measure in (_MEASURE.match(text or "fatal_push") for text in texts):
                if measure and measure[1] != "fatal_push":  # the search says why it cannot be one
                    base = measure[1].removesuffix("_per_length").removesuffix("_per_time")
                    allowed = names("optimise.OBJECTIVES") + names("optimise.NAMED_COSTS")
                    check_choice(option, base, allowed)

    def run(self) -> int:
        from jaxbiped.continuation._critical_values import range_of

        scene = self.scene.scene()
        assert not isinstance(scene, jb.RedundantScene)
        self.output.make_folder()
        along = list(_parts(self.bifurcations))
        for name in along:
            check_choice("bifurcations", name, jb.parameter_names(scene))
            range_of(scene, name)
        vary = {"vary": _bounds(scene, self.vary), "subject_to": self.subject_to or None}
        how = self.arguments("optimise_gait") | vary
        del how["footsteps"]  # of the certificate's walk
        if self.search is not None:
            how["formulation"] = self.search
        optimum = jb.optimise_gait(scene, **how)
        ended = jb.optimise.Outcome
        tests: dict[str, Any] = {"starts": 0, "footsteps": 0, "bifurcations_along": ()}
        if optimum.outcome is not ended.INTERRUPTED:
            tests = {"starts": self.basin, "bifurcations_along": along}
            tests |= {name: getattr(self, name) for name in _TESTS}
        certificate = jb.optimise.certify(optimum, **tests)
        sense = "minimise" if self.maximise is None else "maximise"
        goal = getattr(self, sense)
        report = Report(self.output.json, self.output.csv)
        _print(report, scene, optimum, goal)
        report.say(*_certificate_lines(certificate))
        figures = {"optimisation": lambda: jb.plot.optimisation(optimum)}
        numbers = _optimum_numbers(optimum, certificate, goal, sense)
        if jb.dynamics.WalkerMotion(optimum.scene.minimal, optimum.gait.measures.state).motors():
            gap = _gap(optimum)
            figures["torques"] = lambda: jb.plot.motor_torques(optimum, gap)
            if gap is not None:
                numbers["torque_gap"] = {name: getattr(gap, name) for name in ("bound", "error")}
                report.say(
                    f"torques that are free in time could save at most {gap.bound:.3g} of "
                    f"{optimum.objective:.6g}"
                )
        if self.front is not None and optimum.outcome is not ended.INTERRUPTED:
            against, bounds, upper = _front_axis(self.front, _unit_of_measure)
            front = jb.optimise.pareto_front(
                optimum.scene, against=against, bounds=bounds, upper=upper, **how
            )
            figures["front"] = lambda: jb.plot.pareto_front(front)
            numbers["front"] = _front_numbers(front)
            report.say("", columns(_FRONT, numbers["front"]))
        report.finish(numbers, optimum.to_csv)
        report.wrote(self.output.draw(figures | gait_figures(optimum.gait)))
        if optimum.outcome is ended.INTERRUPTED or "interrupted" in certificate.failed.values():
            raise options.interrupted("the best design so far is what is reported")
        return int(optimum.outcome in (ended.UNFINISHED, ended.INFEASIBLE))


def _parts(text: str) -> dict[str, str]:
    """Names and bounds, which may be empty, from d=0.05:0.2,r,J; none from "none"."""
    pairs = (part.partition("=") for part in text.split(","))
    bounds = {name.strip(): bounds.strip() for name, _, bounds in pairs}
    return {name: text for name, text in bounds.items() if name not in ("", "none")}


def _front_axis(
    text: str, unit: Callable[[str], str | None] = lambda _: None
) -> tuple[str, list[float], bool]:
    """Measure, its bounds, and whether they are upper ones, from speed>0.4:0.6:5."""
    if not re.search("[<>]", text):
        raise ArgumentError(
            f"front = {text!r} is not allowed: write a measure with < or > and first:last:count, "
            "such as speed>0.4:0.6:5."
        )
    name, (first, last, count) = parse_axis(re.sub("[<>]", "=", text, count=1), unit)
    steps = max(count - 1, 1)
    return name, [first + k * (last - first) / steps for k in range(count)], "<" in text


def _unit_of_measure(name: str) -> str | None:
    """The unit of a measure; None if only a search knows it."""
    known = (jb.optimise.OBJECTIVES | jb.optimise.NAMED_COSTS).get(name)
    return known and known.quantity.unit


def _gap(optimum: "jb.optimise.Optimum") -> "jb.optimise.TorqueGap | None":
    """The gap to torques that are free in time; None where there is none to be told."""
    if optimum.outcome is not jb.optimise.Outcome.CONVERGED:
        return None
    try:
        return jb.optimise.torque_gap(optimum)
    except ArgumentError:  # the objective is not convex in torques, or the feet are compliant
        return None


def _front_numbers(front: "jb.optimise.ParetoFront") -> list[JsonObject]:
    """What is known of each point of a front in SI units."""
    named = {
        "bound": front.bounds,
        "value": front.values(front.against),
        "objective": front.objectives[0],
        "error": front.objectives[1],
        "slope": front.slopes[0],
        "slope_error": front.slopes[1],
        "bound_holds": front.holds,
        "proven": front.proven,
        "dominated": front.dominated,
    }
    rows = zip(*(column.tolist() for column in named.values()), strict=True)
    points = [dict(zip(named, row, strict=True)) for row in rows]
    outcomes = ({"outcome": str(optimum.outcome)} for optimum in front.optima)
    return [point | outcome for point, outcome in zip(points, outcomes, strict=True)]


def _bounds(scene: "jb.Scene | jb.RigidScene", text: str) -> dict[str, tuple[float, float]]:
    """Bounds by name from d=0.05:0.2,r,J."""
    from jaxbiped.continuation._critical_values import farthest_allowed

    values, pairs = jb.parameter_values(scene), {}
    units = units_of(jb.parameter_quantities(scene))
    for name, bounds in _parts(text).items():
        check_choice("vary", name, units)
        if bounds:
            low, high = numbers_in("vary", name, bounds, units[name], ":", 2)
        elif (value := float(values[name])) != 0.0:
            low, high = sorted(farthest_allowed(scene, name, value * x) for x in _USUAL_RANGE)
        else:
            raise ArgumentError(
                f"vary = {name} needs bounds, as its value is 0: write {name}=low:high."
            )
        pairs[name] = (low, high)
    return pairs


def _optimum_numbers(
    optimum: "jb.optimise.Optimum", certificate: "jb.optimise.Certificate", goal: str, sense: str
) -> JsonObject:
    """What is known of an optimum in SI units, for `strict_json`."""
    return {
        "outcome": str(optimum.outcome),
        "message": optimum.message,
        "variables": optimum.variables,
        "objective": {
            "name": goal,
            "sense": sense,
            "value": optimum.objective,
            "error": optimum.error,
            "unit": optimum.quantities[goal].unit,
        },
        "measures": {
            name: {
                "value": value,
                "error": optimum.known.errors[name],
                "beyond_range": name in optimum.known.beyond_range,
            }
            for name, value in optimum.known.values.items()
        },
        "sensitivities": _sensitivity_numbers(optimum),
        "history": records(optimum.history),
        "evaluations": optimum.evaluations,
        "lost": optimum.lost,
        "unmeasured": optimum.unmeasured,
        "certificate": _certificate_numbers(certificate),
    }


def _sensitivity_numbers(optimum: "jb.optimise.Optimum") -> list[JsonObject]:
    """Derivatives of an optimum with respect to each fixed number, SI units."""
    known = optimum.sensitivities
    return [
        {
            "parameter": name,
            "objective": float(known.objective[k]),
            "objective_error": float(known.objective_errors[k]),
            "variables": {n: float(row[k]) for n, row in known.variables.items()},
            "variable_errors": {n: float(row[k]) for n, row in known.variable_errors.items()},
        }
        for k, name in enumerate(known.parameters)
    ]


def _certificate_numbers(certificate: "jb.optimise.Certificate") -> JsonObject:
    kkt, (norm, norm_error) = certificate.optimality, certificate.sensitivity_norm
    basin, push = certificate.basin, certificate.fatal_push
    numbers = {
        "kkt_residual": kkt.residual,
        "kkt_residual_error": kkt.error,
        "excess": kkt.excess,
        "constraints": records(kkt.requirements),
        "bounds": records(kkt.bounds),
    } | records(certificate)
    del numbers["optimality"]
    return numbers | {
        "sensitivity_norm": {"value": norm, "error": norm_error},
        "basin": basin and dataclasses.asdict(basin),
        "fatal_push": push and {"distance": push.distance, "push": push.push},
    }


def _print(
    report: Report, scene: "jb.Scene | jb.RigidScene", optimum: "jb.optimise.Optimum", goal: str
) -> None:
    units, values = jb.parameter_quantities(scene), jb.parameter_values(scene)
    variables = {
        "variable": "{0[0]}",
        "began": "{0[1]:.6g}",
        "best": "{0[2]:.6g}",
        "unit": "{0[3].unit_in_text}",
    }
    rows = [(name, float(values[name]), x, units[name]) for name, x in optimum.variables.items()]
    measures = {
        "measure": "{0[0]}",
        "began": "{0[1]}",
        "best": "{0[2]}",
        "error": "{0[3]}",
        "unit": "{0[4].unit_in_text}",
    }
    report.say(columns(variables, rows), "", columns(measures, _measures(optimum)), "")
    report.say(
        f"{goal} {optimum.objective:.6g}, {optimum.outcome} after {len(optimum.history)} "
        f"iterations and {optimum.evaluations} gaits ({optimum.message})"
    )
    if optimum.sensitivities.message:
        report.say(f"sensitivities: not known. {optimum.sensitivities.message}", "")
    else:
        report.say("", columns(_SENSITIVITY, _sensitivity_numbers(optimum)), "")


def _measures(optimum: "jb.optimise.Optimum") -> Iterator[tuple[object, ...]]:
    """Each measure, its first value, its best one and the error, or more than a range holds."""
    first = optimum.history[0].measures if optimum.history else {}
    for name, value in optimum.known.values.items():
        if name in optimum.quantities:
            began = f"{first[name]:.6g}" if name in first else "–"
            best, error = f"{value:.6g}", f"{optimum.known.errors[name]:.1e}"
            if name in optimum.known.beyond_range:
                best, error = f"> {best}", "–"
            yield name, began, best, error, optimum.quantities[name]


def _certificate_lines(certificate: "jb.optimise.Certificate") -> Iterator[str]:
    kkt, basin, walk = certificate.optimality, certificate.basin, certificate.walk
    yield "optimality: residual {:.1e} ± {:.1e}, requirements missed by {:.1e}".format(*kkt[:3])
    for limit in (*kkt.requirements, *kkt.bounds):
        if limit.active:
            yield (
                f"held by {limit.name} at {limit.bound:.6g}: multiplier {limit.multiplier:.4g} ± "
                f"{limit.multiplier_error:.1e}"
            )
    pairs = zip(certificate.multipliers, certificate.multiplier_errors, strict=True)
    sizes = ", ".join(f"{abs(size):.4f} ± {error:.0e}" for size, error in list(pairs)[:3])
    yield (
        f"multipliers: {sizes}; the one that must be 1 is off by "
        f"{certificate.unit_multiplier_error:.1e}; {_STABLE[certificate.stable]}"
    )
    yield "sensitivity norm {:.4g} ± {:.1e}".format(*certificate.sensitivity_norm)
    if basin is not None:
        yield (
            f"basin: {basin.estimate:.3f} of the starts about the gait ({basin.low:.3f} to "
            f"{basin.high:.3f})"
        )
    if certificate.fatal_push is not None:
        yield f"smallest fatal push seen: {certificate.fatal_push.distance:.4f} (scaled)"
    if walk is not None:
        back = "back to the gait" if walk.returned else "NOT back to the gait"
        yield f"walk from a push of {walk.push:g}: {walk.footsteps} footsteps, {back}"
    for nearest in certificate.nearest_bifurcations:
        times = "" if math.isnan(nearest.ratio) else f" ({nearest.ratio:.3g} times its value)"
        if nearest.kind is None:
            yield f"no bifurcation along {nearest.along} in the range that was followed"
        else:
            place = f"{nearest.kind} at {nearest.value:.6g}{times}"
            yield f"along {nearest.along} the nearest is {place}"
    for name, why in certificate.failed.items():
        yield f"{name}: not known ({why})"
    if (other := certificate.other_engine) is not None:
        yield (
            f"engine {other.engine}: period differs by {other.period_difference:.1e}, length by "
            f"{other.length_difference:.1e}, spectral radius by {other.radius_difference:.1e}"
        )


class Fit(options.Command, of=("fit_gait",)):
    """Fit parameters to measured gaits; print estimates, errors and undetermined parameters."""

    file: Annotated[Positional[Path], _IS_MEASURED]
    """File of measured gaits, CSV or JSON (see jaxbiped.identify.read_measured)."""
    vary: str
    """Names of the parameters to fit, separated by commas: K,c,mu_kinetic."""
    scene: Annotated[SceneOptions, minimal(_REDUNDANT_FIT)]
    accuracy: options.GaitAccuracy
    engine: options.Engine
    max_evaluations: options.Count
    output: options.OutputOptions

    def check_names(self, scene: SceneOptions) -> None:
        """Raises `ArgumentError` for parameters that the scene lacks."""
        for name in self.names:
            scene.check_parameter("vary", name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters to fit."""
        return tuple(name.strip() for name in self.vary.split(",") if name.strip())

    def run(self) -> int:
        scene = self.scene.scene()
        assert not isinstance(scene, jb.RedundantScene)
        self.output.make_folder()
        measured, how = jb.identify.read_measured(self.file, scene), self.arguments("fit_gait")
        fit = jb.fit_gait(scene, self.names, measured, **how)
        report = Report(self.output.json, self.output.csv)
        parts = (jb.parameter_quantities(scene), fit.estimates, fit.standard_errors, fit.intervals)
        report.say(
            columns(_ESTIMATE, [(name, *(part[name] for part in parts)) for name in self.names])
        )
        report.say(
            f"{fit.ending} after {fit.evaluations} scenes; chi squared {fit.chi_squared:.3g} at "
            f"{fit.freedom} degrees of freedom (p = {fit.p_value:.2g})"
        )
        if fit.undetermined:
            report.say(f"these data do not determine {', '.join(fit.undetermined)}")
        if fit.one_sided:
            report.say(f"limited on one side only: {', '.join(fit.one_sided)}")
        if fit.at_bounds:
            report.say(f"held by a bound: {', '.join(fit.at_bounds)}")
        numbers = vars(fit) | {"ending": str(fit.ending), "intervals_95": fit.intervals}
        del numbers["intervals"]
        also = {"chi_squared": fit.chi_squared, "p_value": fit.p_value}
        report.finish(numbers | also, fit.to_csv)
        report.wrote(self.output.draw({"fit": lambda: jb.plot.fit(fit)}))
        if fit.ending is jb.identify.FitEnding.INTERRUPTED:
            raise options.interrupted("the best estimates so far are what is reported")
        return 0 if fit.ending is jb.identify.FitEnding.CONVERGED else 1

"""Parameters of a walker from measured gaits, and whether their intervals hold the truth.

Writes identify.png. Gaits of the seed's walker on three slopes are measured with noise, over and
over; K, c and mu_kinetic are fitted to each set from a start that is far off. Such data limit the
Stribeck rate xi from below at most, and the fit says so. The same is done in settings where
intervals are wide, the model bends or a parameter is undetermined: K beside c, friction's pair, a
rigid walker's inertia and centre of mass, and angles of either walker on a clock that is not known.
"""

import time
from typing import Any, NamedTuple

import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

SLOPES = (0.01, 0.02, 0.04)
NOISE = {"period": 1e-5, "step_length": 1e-4, "peak_normal": 1e-3}
"""Relative standard deviations of the means over many footsteps."""
START = {"K": 1.3e6, "c": 0.7e7, "mu_kinetic": 0.3}
LABELS = {"K": "stiffness K", "c": "damping c", "mu_kinetic": "kinetic friction"}
SETS, QUICK_SETS = 200, 3


class Setting(NamedTuple):
    """A walker, where fits begin, and absolute deviations of its measures.

    `angles`: deviation of 12 leg angles on a clock of its own, and no measures are then taken.
    """

    scene: Any
    start: dict[str, float]
    deviations: dict[str, float]
    angles: float | None = None


COARSE = {"period": 3e-3, "step_length": 3e-3}
CONTACT = {"K": 1.3e6, "c": 0.8e7}
SETTINGS = {
    "contact": Setting(jb.seed_scene(), CONTACT, COARSE),
    "contact by angles": Setting(jb.seed_scene(), CONTACT, {}, 1e-4),
    "friction": Setting(
        jb.seed_scene(), {"mu_static": 0.6, "mu_kinetic": 0.3}, dict.fromkeys(COARSE, 1e-4)
    ),
    "slope and inertia by angles": Setting(jb.seed_scene(), {"slope": 0.025, "J": 0.012}, {}, 1e-4),
    "rigid": Setting(rigid_seed(), {"J": 0.012, "d": 0.12}, COARSE),
    "rigid by angles": Setting(rigid_seed(), {"J": 0.0144}, {}, 0.02),
}
"""Those with wide intervals, bent valleys or undetermined parameters."""


@experiment
def main(options: Options):
    random = np.random.default_rng(7)
    scene = jb.seed_scene()
    gaits = gaits_of(scene, "balanced")
    start = jb.with_parameters(scene, START)

    def fit(names):
        return jb.fit_gait(start, names, measured(gaits, random, NOISE, relative=True))

    with_xi = fit((*START, "xi"))
    count, began = options.sized(SETS, QUICK_SETS), time.perf_counter()
    fits = [fit(tuple(START)) for _ in tqdm(range(count), unit="fits")]
    seconds = time.perf_counter() - began
    scores, rows = {}, {}
    for name in START:
        value = float(jb.parameter_values(scene)[name])
        errors = np.array([fit.standard_errors[name] for fit in fits])
        estimates = np.array([fit.estimates[name] for fit in fits])
        inside = [fit.intervals[name][0] <= value <= fit.intervals[name][1] for fit in fits]
        scores[name] = (estimates - value) / errors
        rows[name] = {
            "truth": value,
            "mean_estimate": float(np.mean(estimates)),
            "scatter": float(np.std(estimates)),
            "mean_standard_error": float(np.mean(errors)),
            "inside_95": float(np.mean(inside)),
        }
    draw(options, scores)
    return {
        "sets": count,
        "converged": sum(fit.ending is jb.identify.FitEnding.CONVERGED for fit in fits),
        "parameters": rows,
        "without_upper_end_with_xi": [
            name for name, (_, high) in with_xi.intervals.items() if not np.isfinite(high)
        ],
        "settings": {name: coverage(each, count, random) for name, each in SETTINGS.items()},
        "mean_chi_squared": float(np.mean([fit.chi_squared for fit in fits])),
        "freedom": fits[0].freedom,
        "seconds": seconds,
    }


def gaits_of(scene, accuracy):
    """The gaits on all slopes."""
    how = dict(parameters=(), radius_sensitivities=False, accuracy=accuracy)
    return [jb.find_gait(jb.with_parameters(scene, {"slope": slope}), **how) for slope in SLOPES]


def measured(gaits, random, deviations, *, relative=False):
    """Measures of the gaits with noise of these standard deviations."""
    found = []
    for slope, gait in zip(SLOPES, gaits, strict=True):
        noisy = {}
        for name, off in deviations.items():
            exact = float(getattr(gait.measures, name))
            off = exact * off if relative else off
            noisy[name] = exact + off * random.standard_normal(), off
        found.append(jb.identify.MeasuredGait(noisy, conditions={"slope": slope}))
    return found


def measured_angles(gait, random, deviation):
    """Angles of a gait, on a clock that begins anywhere."""
    clock, states = np.asarray(gait.orbit[0])[0], gait.orbit[1]
    known = np.isfinite(clock)
    some = np.searchsorted(clock[known], np.linspace(0.03, 0.97, 12) * clock[known][-1])
    both = [np.asarray(each[0])[some] for each in (states.theta_1, states.theta_2)]
    noisy = [each + deviation * random.standard_normal(len(some)) for each in both]
    angles = jb.identify.MeasuredAngles(clock[some] - clock[some[0]], deviation, *noisy)
    return [jb.identify.MeasuredGait({}, angles=angles)]


def coverage(setting, count, random):
    """What fits tell of each parameter, and how often its interval holds the truth."""
    own = jb.parameter_values(setting.scene)
    truth = {name: float(own[name]) for name in setting.start}
    how = dict(parameters=(), radius_sensitivities=False, accuracy="tight")
    start = jb.with_parameters(setting.scene, setting.start)
    if setting.angles is None:
        gaits = gaits_of(setting.scene, "tight")
    else:
        gaits = [jb.find_gait(setting.scene, **how)]
    fits = []
    for _ in tqdm(range(count), unit="fits"):
        if setting.angles is None:
            data = measured(gaits, random, setting.deviations)
        else:
            data = measured_angles(gaits[0], random, setting.angles)
        fits.append(jb.fit_gait(start, tuple(truth), data))
    return {
        "sets": count,
        "converged": sum(fit.ending is jb.identify.FitEnding.CONVERGED for fit in fits),
        "p_below_0.05": sum(fit.p_value < 0.05 for fit in fits) / count,
        "parameters": {name: told_of(fits, name, value) for name, value in truth.items()},
    }


def told_of(fits, name, value):
    """Of one parameter: numbers of fits, and how many of its intervals hold the truth."""
    told = [fit.intervals[name] for fit in fits if np.isfinite(fit.intervals[name][0])]
    inside = sum(bool(low <= value <= high) for low, high in told)
    return {
        "told": len(told),
        "one_sided": sum(name in fit.one_sided for fit in fits),
        "undetermined": sum(name in fit.undetermined for fit in fits),
        "inside_95": inside / len(told) if told else None,
    }


def draw(options, scores):
    """Distributions of (estimate − truth) / standard error beside the normal one."""
    figure = new_figure(9.0, 3.0)
    axes = figure.subplots(1, len(scores), sharey=True)
    edges, fine = np.linspace(-4.0, 4.0, 25), np.linspace(-4.0, 4.0, 201)
    for axis, (name, values) in zip(axes, scores.items(), strict=True):
        axis.hist(values, edges, density=True, color="tab:blue", alpha=0.6, label="fits")
        axis.plot(fine, np.exp(-0.5 * fine**2) / np.sqrt(2.0 * np.pi), "k", label="normal")
        axis.set_xlabel(f"error of {LABELS[name]},\nin standard errors")
    axes[0].set_ylabel("density")
    axes[0].legend(frameon=False)
    options.save(figure, "identify.png")


if __name__ == "__main__":
    main()

"""Parameters of a walker from measured gaits, and whether their intervals hold the truth.

Writes identify.png. Gaits of the seed's walker on three slopes are measured with noise, over and
over; K, c and mu_kinetic are fitted to each set from a start that is far off. Such data limit the
Stribeck rate xi from below at most, and the fit says so. The same is done in settings where
intervals are wide, the model bends or a parameter is undetermined: K beside c, friction's pair, a
rigid walker's inertia and centre of mass, and angles of either walker on a clock that is not known.
Fits lie in identify.jsonl as they come: a run that was cut off goes on.
"""

import functools
import time
from typing import Any, NamedTuple

import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

SLOPES = (0.01, 0.02, 0.04)
LABELS = {"K": "stiffness K", "c": "damping c", "mu_kinetic": "kinetic friction"}
SETS, QUICK_SETS = 200, 3
SEED = 7
TOLD = ("estimates", "standard_errors", "intervals", "one_sided", "undetermined")
"""Of a fit, beside what is computed from it."""


class Setting(NamedTuple):
    """A walker, where fits begin, and standard deviations of its measures on the slopes.

    `angles`: deviation of 12 leg angles on a clock of its own, and no measures are then taken.
    """

    scene: Any
    start: dict[str, float]
    deviations: dict[str, float]
    angles: float | None = None
    relative: bool = False


PRECISE = {"period": 1e-5, "step_length": 1e-4, "peak_normal": 1e-3}
"""Relative, of the means over many footsteps."""
COARSE = {"period": 3e-3, "step_length": 3e-3}
CONTACT = {"K": 1.3e6, "c": 0.8e7}
SEED_SCENE = jb.seed_scene()
SETTINGS = {
    "precise": Setting(
        SEED_SCENE, {"K": 1.3e6, "c": 0.7e7, "mu_kinetic": 0.3}, PRECISE, relative=True
    ),
    "contact": Setting(SEED_SCENE, CONTACT, COARSE),
    "contact by angles": Setting(SEED_SCENE, CONTACT, {}, 1e-4),
    "friction": Setting(
        SEED_SCENE, {"mu_static": 0.6, "mu_kinetic": 0.3}, dict.fromkeys(COARSE, 1e-4)
    ),
    "slope and inertia by angles": Setting(SEED_SCENE, {"slope": 0.025, "J": 0.012}, {}, 1e-4),
    "rigid": Setting(rigid_seed(), {"J": 0.012, "d": 0.12}, COARSE),
    "rigid by angles": Setting(rigid_seed(), {"J": 0.0144}, {}, 0.02),
}
"""After the first, those with wide intervals, bent valleys or undetermined parameters."""


@experiment
def main(options: Options):
    rows, count = options.store("identify", seed=SEED), options.sized(SETS, QUICK_SETS)
    fitters = {name: fitter(name) for name in SETTINGS}
    fits = {name: [] for name in SETTINGS}
    for index in tqdm(range(count), unit="sets"):
        for name, fit in fitters.items():
            fits[name].append(rows.row(f"{name} {index}", fit, index))
    xi = rows.row("precise with xi", fitter("precise", "xi"), 0)
    precise, truth = fits["precise"], truth_of(SETTINGS["precise"])
    draw(options, precise, truth)
    return {
        "sets": count,
        "parameters": {name: scatter(precise, name, value) for name, value in truth.items()},
        "without_upper_end_with_xi": [
            name for name, (_, high) in xi["intervals"].items() if not np.isfinite(high)
        ],
        "settings": {name: coverage(SETTINGS[name], each) for name, each in fits.items()},
    }


def fitter(name, *more):
    """A function that fits a setting's parameters, and more, to data with noise of their own."""
    place, setting = list(SETTINGS).index(name), SETTINGS[name]
    gaits = functools.cache(lambda: gaits_of(setting))  # no search if all fits are known
    start = jb.with_parameters(setting.scene, setting.start)

    def fit(index):
        data = measured(setting, gaits(), np.random.default_rng((SEED, place, index)))
        began = time.process_time()
        told = jb.fit_gait(start, (*setting.start, *more), data)
        return {
            "cpu_s": time.process_time() - began,
            "converged": told.ending is jb.identify.FitEnding.CONVERGED,
            "chi_squared": told.chi_squared,
            "freedom": told.freedom,
            "p_value": told.p_value,
            **{name: getattr(told, name) for name in TOLD},
        }

    return fit


def gaits_of(setting):
    """Its gaits on all slopes, or only the one whose angles are measured."""
    how = dict(parameters=(), radius_sensitivities=False, accuracy="tight")
    if setting.angles is not None:
        return [jb.find_gait(setting.scene, **how)]
    scenes = (jb.with_parameters(setting.scene, {"slope": slope}) for slope in SLOPES)
    return [jb.find_gait(scene, **how) for scene in scenes]


def measured(setting, gaits, random):
    """Measures of the gaits, or angles, with noise."""
    if setting.angles is not None:
        return measured_angles(gaits[0], random, setting.angles)
    found = []
    for slope, gait in zip(SLOPES, gaits, strict=True):
        noisy = {}
        for name, off in setting.deviations.items():
            exact = float(getattr(gait.measures, name))
            off = exact * off if setting.relative else off
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


def scatter(fits, name, truth):
    """Estimates of one parameter, and their standard errors."""
    estimates = [fit["estimates"][name] for fit in fits]
    errors = [fit["standard_errors"][name] for fit in fits]
    return {
        "truth": truth,
        "mean_estimate": float(np.mean(estimates)),
        "scatter": float(np.std(estimates)),
        "mean_standard_error": float(np.mean(errors)),
        "inside_95": told_of(fits, name, truth)["inside_95"],
    }


def coverage(setting, fits):
    """What fits tell of each parameter, and how often its interval holds the truth."""
    truth = truth_of(setting)
    return {
        "sets": len(fits),
        "converged": sum(fit["converged"] for fit in fits),
        "p_below_0.05": float(np.mean([fit["p_value"] < 0.05 for fit in fits])),
        "mean_chi_squared": float(np.mean([fit["chi_squared"] for fit in fits])),
        "median_cpu_s": float(np.median([fit["cpu_s"] for fit in fits])),
        "parameters": {name: told_of(fits, name, value) for name, value in truth.items()},
    }


def truth_of(setting):
    """The true values of its parameters."""
    own = jb.parameter_values(setting.scene)
    return {name: float(own[name]) for name in setting.start}


def told_of(fits, name, value):
    """Of one parameter: numbers of fits, and how many of its intervals hold the truth."""
    ends = [fit["intervals"][name] for fit in fits]
    told = [(low, high) for low, high in ends if np.isfinite(low)]
    inside = sum(low <= value <= high for low, high in told)
    return {
        "told": len(told),
        "one_sided": sum(name in fit["one_sided"] for fit in fits),
        "undetermined": sum(name in fit["undetermined"] for fit in fits),
        "inside_95": inside / len(told) if told else None,
    }


def draw(options, fits, truth):
    """Distributions of (estimate − truth) / standard error beside the normal one."""
    figure = new_figure(9.0, 3.0)
    axes = figure.subplots(1, len(truth), sharey=True)
    edges, fine = np.linspace(-4.0, 4.0, 25), np.linspace(-4.0, 4.0, 201)
    for axis, (name, value) in zip(axes, truth.items(), strict=True):
        off = [(fit["estimates"][name] - value) / fit["standard_errors"][name] for fit in fits]
        axis.hist(off, edges, density=True, color="tab:blue", alpha=0.6, label="fits")
        axis.plot(fine, np.exp(-0.5 * fine**2) / np.sqrt(2.0 * np.pi), "k", label="normal")
        axis.set_xlabel(f"error of {LABELS[name]},\nin standard errors")
    axes[0].set_ylabel("density")
    axes[0].legend(frameon=False)
    options.save(figure, "identify.png")


if __name__ == "__main__":
    main()

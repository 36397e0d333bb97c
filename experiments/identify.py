"""Parameters of a walker from measured gaits, and whether their intervals hold the truth.

Writes identify.png. Gaits of the seed's walker on three slopes are measured with noise, over and
over; K, c and mu_kinetic are fitted to each set from a start that is far off. Of the Stribeck rate
xi such data tell nothing, and the fit says so. The same is done in settings where intervals are
wide, the model bends or a parameter is undetermined: friction's pair, a rigid walker's inertia and
centre of mass, and its angles on a clock that is not known.
"""

import time
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse
from tqdm import tqdm

import jaxbiped as jb

SLOPES = (0.01, 0.02, 0.04)
NOISE = {"period": 1e-5, "step_length": 1e-4, "peak_normal": 1e-3}
"""Relative standard deviations of the means over many footsteps."""
START = {"K": 1.3e6, "c": 0.7e7, "mu_kinetic": 0.3}
LABELS = {"K": "stiffness K", "c": "damping c", "mu_kinetic": "kinetic friction"}
SETS, QUICK_SETS = 200, 3


class Setting(NamedTuple):
    """A walker, absolute deviations of its measures, and where fits begin.

    `angles`: deviation of 12 leg angles on a clock of its own, and no measures are then taken.
    """

    scene: jb.Scene | jb.RigidScene
    start: dict[str, float]
    deviations: dict[str, float]
    angles: float | None = None


def settings() -> dict[str, Setting]:
    """Those with wide intervals, by name."""
    rigid, coarse = jb.ladder()["rigid"], {"period": 3e-3, "step_length": 3e-3}
    fine = dict.fromkeys(coarse, 1e-4)
    return {
        "friction": Setting(jb.seed_scene(), {"mu_static": 0.5, "mu_kinetic": 0.3}, fine),
        "rigid": Setting(rigid, {"J": 0.012, "d": 0.12}, coarse),
        "angles": Setting(rigid, {"J": 0.0144}, {}, 0.02),
    }


def measured_in(
    setting: Setting, gaits: list[jb.Gait], random: np.random.Generator
) -> list[jb.identify.MeasuredGait]:
    """Measures of its gaits with noise, or angles of the first."""
    if setting.angles is not None:
        clock, states = np.asarray(gaits[0].orbit[0])[0], gaits[0].orbit[1]
        some = np.flatnonzero(np.isfinite(clock))[4:-4:7][:12]
        both = [np.asarray(each[0])[some] for each in (states.theta_1, states.theta_2)]
        noisy = [each + setting.angles * random.standard_normal(len(some)) for each in both]
        angles = jb.identify.MeasuredAngles(clock[some] - clock[some[0]], setting.angles, *noisy)
        return [jb.identify.MeasuredGait({}, {"slope": SLOPES[0]}, angles)]
    return [
        jb.identify.MeasuredGait(
            {
                name: (float(getattr(gait.measures, name)) + off * random.standard_normal(), off)
                for name, off in setting.deviations.items()
            },
            conditions={"slope": slope},
        )
        for slope, gait in zip(SLOPES, gaits, strict=True)
    ]


def coverage(setting: Setting, count: int, random: np.random.Generator) -> dict[str, object]:
    """In how many fits each parameter was told, and how often its interval held the truth."""
    own = jb.parameter_values(setting.scene)
    truth = {name: float(own[name]) for name in setting.start}
    plain = dict(parameters=(), radius_sensitivities=False, accuracy="tight")
    scenes = [jb.with_parameters(setting.scene, {"slope": slope}) for slope in SLOPES]
    gaits = [jb.find_gait(scene, **plain) for scene in scenes]
    start = jb.with_parameters(setting.scene, setting.start)
    told, inside, unlikely = dict.fromkeys(truth, 0), dict.fromkeys(truth, 0), 0
    for _ in tqdm(range(count), unit="fits"):
        fit = jb.fit_gait(start, tuple(truth), measured_in(setting, gaits, random))
        unlikely += fit.p_value < 0.05
        for name, value in truth.items():
            low, high = fit.intervals[name]
            told[name] += bool(np.isfinite(low))
            inside[name] += bool(low <= value <= high)
    share = {name: inside[name] / told[name] if told[name] else None for name in truth}
    return {"sets": count, "told": told, "inside_95": share, "p_below_0.05": unlikely / count}


def measured(gaits: list[jb.Gait], random: np.random.Generator) -> list[jb.identify.MeasuredGait]:
    """The gaits' measures with noise."""
    found = []
    for slope, gait in zip(SLOPES, gaits, strict=True):
        exact = {name: float(getattr(gait.measures, name)) for name in NOISE}
        seen = {
            name: (exact[name] * (1.0 + noise * random.standard_normal()), exact[name] * noise)
            for name, noise in NOISE.items()
        }
        found.append(jb.identify.MeasuredGait(seen, conditions={"slope": slope}))
    return found


def draw(options: Options, scores: dict[str, np.ndarray]) -> None:
    """Distributions of (estimate − truth) / standard error beside the normal one."""
    figure, axes = plt.subplots(1, len(scores), figsize=(9.0, 3.0), sharey=True, layout="tight")
    edges = np.linspace(-4.0, 4.0, 25)
    fine = np.linspace(-4.0, 4.0, 201)
    for axis, (name, values) in zip(axes, scores.items(), strict=True):
        axis.hist(values, edges, density=True, color="tab:blue", alpha=0.6, label="fits")
        axis.plot(fine, np.exp(-0.5 * fine**2) / np.sqrt(2.0 * np.pi), "k", label="normal")
        axis.set_xlabel(f"error of {LABELS[name]},\nin standard errors")
    axes[0].set_ylabel("density")
    axes[0].legend(frameon=False)
    options.save(figure, "identify.png")


def main() -> None:
    options = parse(__doc__)
    random = np.random.default_rng(7)
    scene = jb.seed_scene()
    truth = {name: float(jb.parameter_values(scene)[name]) for name in START}
    plain = dict(parameters=(), radius_sensitivities=False)
    gaits = [jb.find_gait(jb.seed_scene(slope=slope), **plain) for slope in SLOPES]
    start = jb.with_parameters(scene, START)
    with_xi = jb.fit_gait(start, (*START, "xi"), measured(gaits, random))
    count = QUICK_SETS if options.quick else SETS
    begun, fits = time.perf_counter(), []
    for _ in tqdm(range(count), unit="fits"):
        fits.append(jb.fit_gait(start, tuple(START), measured(gaits, random)))
    seconds = time.perf_counter() - begun
    scores, rows = {}, {}
    for name, value in truth.items():
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
        options.say(
            f"{name}: {np.mean(estimates):.6g} ± {np.std(estimates):.2g} of {value:g}, standard "
            f"error {np.mean(errors):.2g}, truth in {100 * np.mean(inside):.1f} % of the intervals"
        )
    options.say(f"{count} fits in {seconds:.1f} s; untold: {', '.join(with_xi.undetermined)}")
    draw(options, scores)
    others = {}
    for name, setting in settings().items():
        others[name] = coverage(setting, count, random)
        options.say(f"{name}: {others[name]}")
    numbers = {
        "sets": count,
        "converged": sum(fit.ending is jb.identify.FitEnding.CONVERGED for fit in fits),
        "parameters": rows,
        "undetermined_with_xi": list(with_xi.undetermined),
        "settings": others,
        "mean_chi_squared": float(np.mean([fit.chi_squared for fit in fits])),
        "freedom": fits[0].freedom,
        "seconds": seconds,
    }
    options.finish(numbers)


if __name__ == "__main__":
    main()

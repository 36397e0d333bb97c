"""Parameters of a walker from measured gaits, and whether their intervals hold the truth.

Writes identify.png. Gaits of the seed's walker on three slopes are measured with noise, over and
over; K, c and mu_kinetic are fitted to each set from a start that is far off. Of the Stribeck rate
xi such data tell nothing, and the fit says so.
"""

import time

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
    figure.savefig(options.path("identify.png"), dpi=150)


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
    numbers = {
        "sets": count,
        "converged": sum(fit.ending is jb.identify.FitEnding.CONVERGED for fit in fits),
        "parameters": rows,
        "undetermined_with_xi": list(with_xi.undetermined),
        "mean_chi_squared": float(np.mean([fit.chi_squared for fit in fits])),
        "freedom": fits[0].freedom,
        "seconds": seconds,
    }
    options.finish(numbers)


if __name__ == "__main__":
    main()

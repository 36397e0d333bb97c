"""Designs that hold under scatter of the contact and of the slope, and the trade that they make.

Writes optimise_robust.png. The leg is made as fast as a bound of the spectral radius allows: for
the nominal walker, in the mean over an ensemble, and for its worst member. Stiffness, damping,
Stribeck rate and slope differ from member to member. Then the front of speed against radius. Each
design is tried on an ensemble that it was not made for.
"""

import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

LEG = {"d": (0.05, 0.2), "r": (0.04, 0.12), "J": (0.003, 0.02)}
SCATTER = {"K": 0.3, "c": 0.3, "xi": 0.3, "slope": 0.1}
RIGID_SCATTER = {"slope": 0.1, "J": 0.05}
BOUND = 0.4
TRIED, QUICK_TRIED = 64, 8
BOUNDS, QUICK_BOUNDS = np.linspace(0.2, 0.5, 7), np.array([0.35, 0.5])
KINDS = ("nominal", "mean", "worst")


@experiment
def main(options: Options):
    scene = options.sized(jb.seed_scene(), rigid_seed())
    scatter = options.sized(SCATTER, RIGID_SCATTER)
    found = {kind: design(options, scene, scatter, kind) for kind in KINDS}
    front = jb.optimise.pareto_front(
        scene,
        vary=LEG,
        maximise="speed",
        against="spectral_radius",
        bounds=options.sized(BOUNDS, QUICK_BOUNDS)[::-1],
        iterations=options.sized(60, 15),
    )
    return {
        "bound": BOUND,
        "scatter": scatter,
        "designs": found,
        "front": {
            "bounds": front.bounds.tolist(),
            "speed_m_s": front.values("speed").tolist(),
            "spectral_radius": front.values("spectral_radius").tolist(),
            "outcomes": [str(best.outcome) for best in front.optima],
            "variables": [best.variables for best in front.optima],
        },
        "picture": draw(options, found, front),
    }


def design(options, scene, scatter, kind):
    """The fastest design under the bound, for the nominal walker or one over its scatter."""
    how = {} if kind == "nominal" else {"scatter": scatter, "criterion": kind}
    best = jb.optimise_gait(
        scene,
        vary=LEG,
        maximise="speed",
        subject_to=f"spectral_radius<{BOUND}",
        iterations=options.sized(100, 15),
        **how,
    )
    speeds, radii = scattered(best.scene, scatter, options.sized(TRIED, QUICK_TRIED))
    return {
        "outcome": str(best.outcome),
        "variables": best.variables,
        "objective": best.objective,
        "tried": {"speed": speeds.tolist(), "spectral_radius": radii.tolist()},
        "mean_speed": float(np.nanmean(speeds)),
        "largest_radius": float(np.nanmax(radii)),
        "share_beyond_bound": float(np.mean(radii > BOUND)),
        "without_a_gait": int(np.isnan(radii).sum()),
        "iterations": len(best.history),
    }


def scattered(scene, scatter, count):
    """Speeds and radii of gaits whose parameters are drawn, NaN where there is none."""
    generator = np.random.default_rng(7)
    own = {name: float(value) for name, value in jb.parameter_values(scene).items()}
    how = dict(parameters=(), radius_sensitivities=False)
    guess = jb.find_gait(scene, **how).measures.state
    rows = []
    for _ in range(count):
        drawn = {n: own[n] * (1.0 + s * generator.uniform(-1.0, 1.0)) for n, s in scatter.items()}
        gait = jb.find_gait(jb.with_parameters(scene, drawn), guess, **how)
        found = gait.outcome is jb.gait.Search.FOUND and bool(gait.sound)
        pair = (float(gait.measures.speed), float(gait.measures.spectral_radius))
        rows.append(pair if found else (np.nan, np.nan))
    return np.asarray(rows).T


def draw(options, found, front):
    figure = new_figure(9.0, 4.0)
    left, right = figure.subplots(1, 2)
    left.plot(front.bounds, front.values("speed"), "o-", ms=4.0)
    left.set(xlabel="bound of the spectral radius", ylabel="largest speed (m/s)")
    for kind, form in zip(KINDS, "os^", strict=True):
        tried = found[kind]["tried"]
        right.plot(tried["spectral_radius"], tried["speed"], form, ms=4.0, mfc="none", label=kind)
    right.axvline(BOUND, color="#595959", ls=":", lw=0.8)
    right.set(xlabel="spectral radius under scatter", ylabel="speed (m/s)")
    right.legend(frameon=False)
    return options.save(figure, "optimise_robust.png")


if __name__ == "__main__":
    main()

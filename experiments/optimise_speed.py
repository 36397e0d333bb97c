"""The fastest gait for a given spectral radius, and the calmest gaits at the seed's own speed.

Writes optimise_speed.png. First the seed's leg (mass centre d, foot radius r, inertia J) is made as
fast as its bounds allow without the spectral radius rising above a bound; by every optimiser, with
what each of them took. Then at no loss of speed: the least response to a push with at most half the
seed's spectral radius, and the least radius, where a hip mass is allowed, too. All are certified:
conditions of optimality, multipliers, sensitivity norm, basin, footsteps. Then what two hundred
iterations of a plain descent take.

Writes optimise_robust.png, too. The leg is made as fast as a bound of the spectral radius allows
for the nominal walker, in the mean over an ensemble, and for its worst member: contact and slope
differ from member to member. Each design is tried on an ensemble that it was not made for. Last the
front of speed against radius.
"""

import functools

import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed
from _timing import timed

import jaxbiped as jb
from jaxbiped.plot.style import legend_below, new_figure

LEG = {"d": (0.05, 0.2), "r": (0.04, 0.12), "J": (0.003, 0.02)}
LARGE = {**LEG, "r": (0.04, 0.16)}
BODY = {**LARGE, "hip_mass": (0.0, 1.0)}
BOUND = 0.4
BOUNDED = dict(vary=LEG, maximise="speed", subject_to=f"spectral_radius<{BOUND}")
OPTIMISERS = ("trust-region", "slsqp", "trust-constr")
DESCENT, QUICK_DESCENT = 200, 3
"""Iterations that are timed."""
SCATTER = {"K": 0.3, "c": 0.3, "xi": 0.3, "slope": 0.1}
RIGID_SCATTER = {"slope": 0.1, "J": 0.05}
TRIED, QUICK_TRIED = 64, 8
BOUNDS, QUICK_BOUNDS = np.linspace(0.2, 0.5, 7), np.array([0.35, 0.5])
KINDS = ("nominal", "mean", "worst")
GOALS = (("maximise", "speed"), ("minimise", "spectral_radius"))


@experiment
def main(options: Options):
    scene = options.sized(jb.seed_scene(), rigid_seed())
    starts = options.sized(4096, 128)
    own = jb.find_gait(scene, parameters=(), radius_sensitivities=False)
    optimisers = options.sized(OPTIMISERS, OPTIMISERS[:1])
    fast = {name: fastest(scene, name) for name in optimisers}
    radius, speed = float(own.measures.spectral_radius), float(own.measures.speed)
    kept, most = {"speed": (speed, None)}, options.sized(200, 30)
    half = {**kept, "spectral_radius": (None, 0.499 * radius)}
    find = functools.partial(jb.optimise_gait, scene)
    least = dict(minimise="spectral_radius")
    calm = dict(minimise="sensitivity_norm", subject_to=half)
    designs = {
        # Its own design, under the same tests.
        "seed": find(vary={"d": (0.0999, 0.1001)}, iterations=1, **least),
        "calmest": find(vary=LARGE, iterations=most, **calm),
        "least radius": find(vary=BODY, iterations=most, subject_to=kept, **least),
    }
    told = {
        name: summary(best) | {"certificate": certified(best, starts)}
        for name, best in designs.items()
    }
    descents = {
        f"{goal} {wanted}": descent(scene, goal, wanted, options.sized(DESCENT, QUICK_DESCENT))
        for goal, wanted in GOALS
    }
    held, front = robust(options, scene, options.sized(SCATTER, RIGID_SCATTER))
    return {
        "fastest": fast,
        "designs": told,
        "descents": descents,
        "robust": held,
        "pictures": [draw(options, own, designs["calmest"]), draw_robust(options, held, front)],
    }


def summary(best):
    return {
        "outcome": str(best.outcome),
        "variables": best.variables,
        "measures": {name: best.known.values[name] for name in ("speed", "spectral_radius")},
        "objective": best.objective,
        "kkt_residual": best.optimality.residual,
        "excess": best.optimality.excess,
        "iterations": len(best.history),
        "evaluations": best.evaluations,
    }


def certified(best, starts):
    found = jb.optimise.certify(best, starts=starts)
    return {
        "kkt_residual": found.optimality.residual,
        "multipliers": [[value.real, value.imag] for value in found.multipliers.tolist()],
        "multiplier_errors": found.multiplier_errors.tolist(),
        "unit_multiplier_error": found.unit_multiplier_error,
        "stable": found.stable,
        "sensitivity_norm": found.sensitivity_norm[0],
        "basin": [found.basin.estimate, found.basin.low, found.basin.high],
        "footsteps": found.walk.footsteps,
        "returned": found.walk.returned,
    }


def fastest(scene, optimiser):
    """By an optimiser; a first call is not timed, for it compiles."""
    jb.optimise_gait(scene, **BOUNDED, optimiser="slsqp", iterations=1)
    how = dict(optimiser=optimiser, iterations=100)
    best, _, cpu = timed(lambda: jb.optimise_gait(scene, **BOUNDED, **how))
    return summary(best) | {"cpu_s": cpu}


def descent(scene, goal, wanted, iterations):
    """CPU time of a descent by Adam, once everything is compiled."""
    problem = {"vary": LEG, goal: wanted, "optimiser": "optax"}
    jb.optimise_gait(scene, **problem, iterations=2)
    best, _, cpu = timed(lambda: jb.optimise_gait(scene, **problem, iterations=iterations))
    return {
        "objective": best.objective,
        "iterations": len(best.history),
        "evaluations": best.evaluations,
        "warm_cpu_s": cpu,
    }


def draw(options, own, best):
    """The iterations, and the multipliers before and after."""
    left, right = new_figure(9.0, 4.0).subplots(1, 2)
    names = ("sensitivity_norm", "spectral_radius")
    left.plot(*([each.measures[name] for each in best.history] for name in names), "o-", ms=3.0)
    half = 0.5 * float(own.measures.spectral_radius)
    left.axhline(half, color="#595959", ls=":", lw=1.2, label="half of the seed's")
    left.set(xlabel=r"gait sensitivity norm, $\|G\|$ (–)", ylabel=r"spectral radius, $\rho$ (–)")
    legend_below(left, columns=2)
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    right.plot(np.cos(angle), np.sin(angle), color="#595959", lw=0.8)
    for gait, name, form in ((own, "seed", "o"), (best.gait, "optimum", "s")):
        values = np.asarray(gait.multipliers)
        right.plot(values.real, values.imag, form, ms=5.0, mfc="none", label=name)
    words = r"real part, Re $\lambda$ (–)", r"imaginary part, Im $\lambda$ (–)"
    right.set(xlabel=words[0], ylabel=words[1], aspect="equal")
    legend_below(right, columns=2)
    return options.save(left.figure, "optimise_speed.png")


def robust(options, scene, scatter):
    """Designs that hold under scatter, and the front of speed against radius."""
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
        "designs": {kind: design(options, scene, scatter, kind) for kind in KINDS},
        "front": {
            "bounds": front.bounds.tolist(),
            "speed_m_s": front.values("speed").tolist(),
            "spectral_radius": front.values("spectral_radius").tolist(),
            "outcomes": [str(best.outcome) for best in front.optima],
            "variables": [best.variables for best in front.optima],
        },
    }, front


def design(options, scene, scatter, kind):
    """The fastest design under the bound, for the nominal walker or one over its scatter."""
    how = {} if kind == "nominal" else {"scatter": scatter, "criterion": kind}
    best = jb.optimise_gait(scene, **BOUNDED, iterations=options.sized(100, 15), **how)
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


def draw_robust(options, held, front):
    left, right = new_figure(9.0, 4.0).subplots(1, 2)
    left.plot(front.bounds, front.values("speed"), "o-", ms=4.0)
    left.set(xlabel="bound of the spectral radius (–)", ylabel="largest speed (m/s)")
    for kind, form in zip(KINDS, "os^", strict=True):
        tried = held["designs"][kind]["tried"]
        right.plot(tried["spectral_radius"], tried["speed"], form, ms=4.0, mfc="none", label=kind)
    right.axvline(BOUND, color="#595959", ls=":", lw=0.8)
    right.set(xlabel=r"spectral radius under scatter, $\rho$ (–)", ylabel="speed (m/s)")
    legend_below(right, columns=3)
    return options.save(left.figure, "optimise_robust.png")


if __name__ == "__main__":
    main()

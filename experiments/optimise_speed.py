"""The fastest gait for a given spectral radius, and the calmest gaits at the seed's own speed.

Writes optimise_speed.png. First the seed's leg (mass centre d, foot radius r, inertia J) is made as
fast as its bounds allow without the spectral radius rising above a bound; by every optimiser, with
what each of them took. Then at no loss of speed: the least response to a push with at most half the
seed's spectral radius, and the least radius, where a hip mass is allowed, too. All are certified:
conditions of optimality, multipliers, sensitivity norm, basin, footsteps. Last, what two hundred
iterations of a plain descent take.
"""

import functools

import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed
from _timing import timed

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

LEG = {"d": (0.05, 0.2), "r": (0.04, 0.12), "J": (0.003, 0.02)}
LARGE = {**LEG, "r": (0.04, 0.16)}
BODY = {**LARGE, "hip_mass": (0.0, 1.0)}
BOUND = 0.4
OPTIMISERS = ("trust-region", "slsqp", "trust-constr")
DESCENT, QUICK_DESCENT = 200, 3
"""Iterations that are timed."""
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
    drawn = draw(options, own, designs["calmest"])
    return {"fastest": fast, "designs": told, "descents": descents, "picture": drawn}


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
    problem = dict(vary=LEG, maximise="speed", subject_to=f"spectral_radius<{BOUND}")
    jb.optimise_gait(scene, **problem, optimiser="slsqp", iterations=1)
    how = dict(optimiser=optimiser, iterations=100)
    best, _, cpu = timed(lambda: jb.optimise_gait(scene, **problem, **how))
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
    figure = new_figure(9.0, 4.0)
    left, right = figure.subplots(1, 2)
    names = ("sensitivity_norm", "spectral_radius")
    left.plot(*([each.measures[name] for each in best.history] for name in names), "o-", ms=3.0)
    left.axhline(0.5 * float(own.measures.spectral_radius), color="#595959", ls=":", lw=0.8)
    left.set(xlabel="gait sensitivity norm", ylabel="spectral radius")
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    right.plot(np.cos(angle), np.sin(angle), color="#595959", lw=0.8)
    for gait, name, form in ((own, "seed", "o"), (best.gait, "optimum", "s")):
        values = np.asarray(gait.multipliers)
        right.plot(values.real, values.imag, form, ms=5.0, mfc="none", label=name)
    right.set(xlabel="real part of a multiplier", ylabel="imaginary part", aspect="equal")
    right.legend(frameon=False)
    return options.save(figure, "optimise_speed.png")


if __name__ == "__main__":
    main()

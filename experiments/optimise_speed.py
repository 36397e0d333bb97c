"""The fastest gait for a given spectral radius, and the calmest gaits at the seed's own speed.

Writes optimise_speed.png. First the seed's leg (mass centre d, foot radius r, inertia J) is made as
fast as its bounds allow without the spectral radius rising above a bound; by every optimiser, with
what each of them took. Then at no loss of speed: the least response to a push with at most half the
seed's spectral radius, and the least radius, where a hip mass is allowed, too. All are certified:
conditions of optimality, multipliers, sensitivity norm, basin, footsteps. Last, what two hundred
iterations of a plain descent take.
"""

import time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse

import jaxbiped as jb

LEG = {"d": (0.05, 0.2), "r": (0.04, 0.12), "J": (0.003, 0.02)}
LARGE = {**LEG, "r": (0.04, 0.16)}
BODY = {**LARGE, "hip_mass": (0.0, 1.0)}
BOUND = 0.4
OPTIMISERS = ("trust-region", "slsqp", "trust-constr")
DESCENT, QUICK_DESCENT = 200, 3
"""Iterations that are timed."""
MOST = {"trust-region": 100, "slsqp": 100, "trust-constr": 100}


def summary(best: jb.optimise.Optimum) -> dict[str, Any]:
    told = best.optimality
    return {
        "outcome": str(best.outcome),
        "variables": best.variables,
        "measures": {name: best.known.values[name] for name in ("speed", "spectral_radius")},
        "objective": best.objective,
        "kkt_residual": told.residual,
        "excess": told.excess,
        "iterations": len(best.history),
        "evaluations": best.evaluations,
    }


def certified(best: jb.optimise.Optimum, starts: int) -> dict[str, Any]:
    found = jb.optimise.certify(best, starts=starts)
    assert found.basin is not None
    assert found.walk is not None
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


def fastest(options: Options, scene: jb.Scene) -> dict[str, Any]:
    """By each optimiser; the first call of each is not timed, for it compiles."""
    found = {}
    for name in OPTIMISERS[:1] if options.quick else OPTIMISERS:
        problem = dict(vary=LEG, maximise="speed", subject_to=f"spectral_radius<{BOUND}")
        jb.optimise_gait(scene, **problem, optimiser="slsqp", iterations=1)  # type: ignore[arg-type]
        began = time.perf_counter()
        best = jb.optimise_gait(scene, **problem, optimiser=name, iterations=MOST[name])  # type: ignore[arg-type]
        seconds = time.perf_counter() - began
        found[name] = summary(best) | {"wall_s": seconds}
        options.say(
            f"{name:>13}: {best.objective:.6f} m/s, {best.outcome}, {len(best.history)} "
            f"iterations, {best.evaluations} gaits, {seconds:.2f} s"
        )
    return found


def descents(options: Options, scene: jb.Scene) -> dict[str, Any]:
    """Times of descents by Adam, once everything is compiled."""
    found = {}
    for goal, wanted in (("maximise", "speed"), ("minimise", "spectral_radius")):
        problem: dict[str, Any] = {"vary": LEG, goal: wanted, "optimiser": "optax"}
        jb.optimise_gait(scene, **problem, iterations=2)
        wall, cpu = time.perf_counter(), time.process_time()
        best = jb.optimise_gait(
            scene, **problem, iterations=QUICK_DESCENT if options.quick else DESCENT
        )
        found[f"{goal} {wanted}"] = times = {
            "objective": best.objective,
            "iterations": len(best.history),
            "evaluations": best.evaluations,
            "warm_wall_s": time.perf_counter() - wall,
            "warm_cpu_s": time.process_time() - cpu,
        }
        options.say(
            f"{goal} {wanted}: {best.objective:.5f} after {len(best.history)} iterations, "
            f"{best.evaluations} gaits, {times['warm_wall_s']:.1f} s "
            f"({times['warm_cpu_s']:.1f} s of processor)"
        )
    return found


def picture(options: Options, own: jb.Gait, best: jb.optimise.Optimum) -> str:
    """The iterations, and the multipliers before and after."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
    names = ("spectral_radius", "sensitivity_norm")
    radii, norms = ([each.measures[name] for each in best.history] for name in names)
    left.plot(norms, radii, "o-", ms=3.0)
    left.axhline(0.5 * float(own.measures.spectral_radius), color="#595959", ls=":", lw=0.8)
    left.set_xlabel("gait sensitivity norm")
    left.set_ylabel("spectral radius")
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    right.plot(np.cos(angle), np.sin(angle), color="#595959", lw=0.8)
    for gait, label, form in ((own, "seed", "o"), (best.gait, "optimum", "s")):
        values = np.asarray(gait.multipliers)
        right.plot(values.real, values.imag, form, ms=5.0, mfc="none", label=label)
    right.set_aspect("equal")
    right.set_xlabel("real part of a multiplier")
    right.set_ylabel("imaginary part")
    right.legend(frameon=False)
    return options.save(figure, "optimise_speed.png")


def main() -> None:
    options = parse(__doc__ or "")
    scene = jb.ladder()["rigid"] if options.quick else jb.seed_scene()
    starts = 128 if options.quick else 4096
    own = jb.find_gait(scene, parameters=(), radius_sensitivities=False)
    fast = fastest(options, scene)
    radius, speed = float(own.measures.spectral_radius), float(own.measures.speed)
    most = 30 if options.quick else 200
    kept = {"speed": (speed, None)}
    designs = {
        # Its own design, under the same tests.
        "seed": jb.optimise_gait(
            scene, vary={"d": (0.0999, 0.1001)}, minimise="spectral_radius", iterations=1
        ),
        "calmest": jb.optimise_gait(
            scene,
            vary=LARGE,
            minimise="sensitivity_norm",
            subject_to={**kept, "spectral_radius": (None, 0.499 * radius)},
            iterations=most,
        ),
        "least radius": jb.optimise_gait(
            scene, vary=BODY, minimise="spectral_radius", subject_to=kept, iterations=most
        ),
    }
    told = {
        name: summary(best) | {"certificate": certified(best, starts)}
        for name, best in designs.items()
    }
    for name, each in told.items():
        certificate = each["certificate"]
        estimate, low, high = certificate["basin"]
        options.say(
            f"{name:>12}: {each['outcome']}, radius {each['measures']['spectral_radius']:.5f} at "
            f"{each['measures']['speed']:.5f} m/s, basin {estimate:.3f} ({low:.3f} to {high:.3f}), "
            f"sensitivity norm {certificate['sensitivity_norm']:.3f}, "
            f"{certificate['footsteps']} footsteps, returned {certificate['returned']}"
        )
    drawn = picture(options, own, designs["calmest"])
    descended = descents(options, scene)
    options.finish({"fastest": fast, "designs": told, "descents": descended, "picture": drawn})


if __name__ == "__main__":
    main()

"""The compass walker's cheapest step on level ground, by laws with ever more numbers.

Writes driven_compass.png: left the torques over a step, in the middle how the Hamiltonian depends
on them, right how far each law's ∫u² lies above that of a torque that is free in time, and how far
the optimum itself promises. Every law is sought from zero torque, without a guess, with
state, period and numbers of the law as unknowns together; a controller in angles also gait by gait.
"""

import time
from itertools import cycle

import jax
import numpy as np
from _experiment import Options, experiment

import jaxbiped as jb
from jaxbiped.dynamics import WalkerMotion
from jaxbiped.plot.style import COLOURS, MARKERS, dress, legend_below, new_figure

FREE = 203.6052460122
"""∫u² of a torque that is free in time [N² m² s], for steps of 0.4 m in 0.7 s."""
LENGTH, PERIOD = 0.4, 0.7
COEFFICIENTS, QUICK_COEFFICIENTS = (5, 6, 8, 12, 16), (6,)
MOST = 400.0
"""Bound of a coefficient [N m]."""
TURNS, QUICK_TURNS = 5, 1
"""Searches of which the times are the median."""
POINTS = 200
"""Of a torque over the step."""


def compass(law):
    """Legs of 5 kg and 1 m with their mass at the middle, 10 kg at the hip."""
    legs = ("leg_1", "leg_2")
    mechanism = jb.Mechanism(
        root="hip",
        root_mass=10.0,
        bodies=tuple(jb.Body(leg, mass=5.0, inertia=0.0, centre=0.5) for leg in legs),
        feet=tuple(jb.Foot(leg, centre=1.0) for leg in legs),
        mirror=(legs,),
        joints=(jb.Motor({"leg_1": 1.0, "leg_2": -1.0}, law, name="hip"),),
    )
    return jb.RigidScene(mechanism, jb.Ground(slope=0.0, g=9.81))


def controlled():
    """A controller of the angle between the legs, and the bounds of its numbers."""
    vary = {"leg.hip.kp": (1.0, 200.0), "leg.hip.kd": (0.01, 20.0), "leg.hip.target": (0.05, 1.5)}
    return compass(jb.actuation.PD(20.0, 1.0, 0.4)), vary


def in_time(kind, count):
    """A law of the time since the strike, from zero torque, and the bounds of its numbers."""
    scene = compass(kind((0.0,) * count, span=PERIOD))
    return scene, {f"leg.hip.torque_{k + 1}": (-MOST, MOST) for k in range(count)}


@experiment
def main(options: Options):
    counts = options.sized(COEFFICIENTS, QUICK_COEFFICIENTS)
    laws = {
        "PD": (*controlled(), ("gait by gait", "together")),
        "cubic": (*in_time(jb.actuation.TimePolynomial, 4), ("together",)),
        **{f"spline of {n}": (*in_time(jb.actuation.TimeSpline, n), ("together",)) for n in counts},
    }
    rows, torques, gaps = [], {}, {}
    for name, (scene, vary, formulations) in laws.items():
        for formulation in formulations:
            best, row = sought(scene, vary, formulation, options.sized(TURNS, QUICK_TURNS))
            gaps[name] = gap = jb.optimise.torque_gap(best)
            row |= {"promised": gap.bound / FREE, "promise_error": gap.error / FREE}
            rows.append({"law": name, "numbers": len(vary), "formulation": formulation, **row})
        if name in ("PD", "cubic", f"spline of {counts[0]}", f"spline of {counts[-1]}"):
            torques[name] = torque_of(best)
    switching = {name: gaps[name] for name in ("cubic", f"spline of {counts[0]}")}
    return {"rows": rows, "picture": draw(options, rows, torques, switching)}


def sought(scene, vary, formulation, turns):
    """The optimum, and what is told of it: with times of the first search and of warm ones."""
    began, seconds = time.process_time(), []
    for _ in range(turns + 1):
        best = jb.optimise_gait(
            scene,
            vary=vary,
            minimise="torque_squared",
            subject_to=[f"step_length=={LENGTH}", f"period=={PERIOD}"],
            formulation=formulation,
        )
        seconds.append(time.process_time() - began)
        began = time.process_time()
    return best, {
        "outcome": str(best.outcome),
        "cost": best.objective,
        "error": best.error,
        "above_free": best.objective / FREE - 1.0,
        "missed": best.optimality.excess,
        "spectral_radius": float(best.gait.measures.spectral_radius),
        "least_curvature": None if best.curvature is None else float(best.curvature.values.min()),
        "evaluations": best.evaluations,
        "cold_cpu_s": seconds[0],
        "warm_cpu_s": float(np.median(seconds[1:])),
    }


def torque_of(best):
    """Times [s] and torques [N m] over the optimum's step."""
    times = np.linspace(0.0, PERIOD, POINTS, endpoint=False)
    walk = jb.simulate(best.scene, best.gait.measures.state, duration=PERIOD, save=times)
    torque = jax.vmap(lambda state: WalkerMotion(best.scene, state).torque("hip"))
    return times, np.asarray(torque(walk.state))


def draw(options, rows, torques, switching):
    left, middle, right = new_figure(13.2, 4.4).subplots(1, 3)
    for (name, (times, torque)), colour in zip(torques.items(), cycle(COLOURS), strict=False):
        left.plot(times, torque, color=colour, label=name, linewidth=1.2)
    dress(left, "Torques of the optima", "time since the strike (s)", "torque of the hip (N m)")
    legend_below(left, columns=3)
    for (name, gap), colour in zip(switching.items(), COLOURS[1:], strict=False):
        middle.plot(gap.times, gap.switching["hip"], color=colour, label=name, linewidth=1.2)
    words = "time since the strike (s)", r"$\partial H/\partial u$ (N m)"
    dress(middle, "What a free torque would change", *words)
    legend_below(middle, columns=2)
    kinds = {"spline in time": "spline", "cubic in time": "cubic", "controller": "PD"}
    for (label, kind), colour, marker in zip(kinds.items(), COLOURS, MARKERS, strict=False):
        own = [row for row in rows if row["law"].startswith(kind)]
        look = dict(color=colour, linestyle="-" if kind == "spline" else "none", markersize=5)
        points = [[row["numbers"] for row in own], [row["above_free"] for row in own]]
        right.plot(*points, marker=marker, label=label, **look)
    points = [[row["numbers"] for row in rows], [row["promised"] for row in rows]]
    look = dict(color="none", edgecolor="black", linewidth=0.7, zorder=3)
    right.scatter(*points, s=90, label="promised by torque_gap", **look)
    words = "numbers of the law (–)", "cost above the free torque's (relative)"
    dress(right, "Cost of a law", *words)
    right.set_yscale("log")
    legend_below(right, columns=3)
    return options.save(left.figure, "driven_compass.png")


if __name__ == "__main__":
    main()

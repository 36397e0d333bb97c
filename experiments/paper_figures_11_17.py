"""The paper's figures 11 to 17: the hip's violation and its cost, by method and integrator.

Beside each figure the paper's sentence about it, and what our numbers say to it.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from _constraint_runs import FLOOR, METHODS, Integrator, relative_costs, truth_of
from _experiment import Options, experiment, label

import jaxbiped as jb
from jaxbiped.plot.style import COLOURS, new_figure
from jaxbiped.trade import work_of

ODE = Integrator("dopri5", rtol=1e-3)
"""What the paper's "ode" is taken for: Dormand and Prince's pair at MATLAB's usual tolerance."""
STIFF = Integrator("rodas4", rtol=1e-6)
FOOTSTEP = 0.4408
PROJECTING = ("index1", "index1aug", "described")
ASTRAY = 0.05
"""Error of the state (SI units) from which a run has failed."""
STYLES = ("-", "--", "-.", ":", "-", "--", "-.")
PARTS = 100
"""Of a curve that wiggles more often than a picture has room for."""
SIZES = dict(single=0.05, batch=2e-3, count=1024, turns=7)
QUICK_SIZES = dict(single=0.02, batch=1e-3, count=64, turns=3)
"""What costs are measured with."""


class Curve(NamedTuple):
    """A violation over time.

    Attributes:
        t: [s]. position: ‖Φ‖ [m]. ending: of the walk, in words. seconds: of a warm run [s].
        error: largest difference from the minimal formulation's state at the end (SI units).
        at_steps: largest ‖Φ‖ at the ends of the steps [m]; in between the curve has the error of
            the dense output, which a projection does not see.
    """

    t: np.ndarray
    position: np.ndarray
    ending: str
    seconds: float
    error: float
    at_steps: float

    def largest(self, start=0.0, stop=1.0):
        """Largest violation between two parts of the whole time, 0 to 1 [m]."""
        part = (self.t >= start * self.t[-1]) & (self.t <= stop * self.t[-1])
        return float(self.position[part].max())

    def numbers(self):
        """What the JSON has of it."""
        return {
            "ending": self.ending,
            "max_violation_m": self.at_steps if np.isfinite(self.at_steps) else None,
            "first_half_m": self.largest(0.0, 0.5),
            "last_half_m": self.largest(0.5, 1.0),
            "state_error": self.error if np.isfinite(self.error) else None,
            "wall_s_run": self.seconds,
        }


def curve_of(scene, method, how, duration, truth, points=1001):
    """The violation of a method over the seed's walk, timed warm."""
    held, times = jb.RedundantScene(scene, method), jnp.linspace(0.0, duration, points)
    options = {name: value for name, value in how._asdict().items() if value is not None}
    options |= dict(save=times, watch=(), extremes=jb.dynamics.violation)
    request = jb.Simulation.prepare(
        held, jb.seed_state(), duration=duration, max_solver_steps=1 << 25, **options
    )
    walk, work = work_of(request, 1)
    off = np.asarray(jb.dynamics.violation(held, walk.state).position)
    final = np.array(jb.dynamics.minimal_state(held, walk.final))
    error, alive = float(np.max(np.abs(final - truth))), np.isfinite(off)
    # One that came to its end somewhere else has failed all the same.
    ending = str(walk.outcome) if error < ASTRAY else "failed"
    at_steps = float(walk.highest.position)
    return Curve(np.asarray(times)[alive], off[alive], ending, work.seconds, error, at_steps)


@experiment
def main(options: Options):
    scene, duration, step = jb.seed_scene(), options.sized(2.0, 0.3), options.sized(1e-6, 1e-5)
    methods = options.sized(METHODS, ("standard", "augmented", "described"))
    tried = {"euler": Integrator("euler", dt=step), "runge2": Integrator("runge2", dt=step)}
    tried |= options.sized({"ode": ODE, "rodas4": STIFF}, {})
    truth = truth_of(scene, duration)
    by_method = {name: curve_of(scene, name, tried["euler"], duration, truth) for name in methods}
    by_integrator = {
        (method, name): by_method[method]
        if name == "euler"
        else curve_of(scene, method, how, duration, truth)
        for method in ("augmented", "standard")
        for name, how in tried.items()
    }
    long = {} if options.quick else hundred_footsteps(scene)
    # Two programs for each method: one that projects and one that does not will do.
    costed = options.sized(methods, ("standard", "described"))
    costs = relative_costs(scene, costed, tried["euler"], **options.sized(SIZES, QUICK_SIZES))
    return {
        "duration_s": duration,
        "dt_s": step,
        "methods": {name: curve.numbers() for name, curve in by_method.items()},
        "integrators": {f"{m} {i}": curve.numbers() for (m, i), curve in by_integrator.items()},
        "costs": costs,
        "hundred_footsteps": {name: curve.numbers() for name, curve in long.items()},
        "verdicts": judged(by_method, by_integrator, long),
        "pictures": draw(options, by_method, by_integrator, costs, long),
    }


def hundred_footsteps(scene):
    duration = 100.0 * FOOTSTEP
    truth = truth_of(scene, duration)
    return {name: curve_of(scene, name, STIFF, duration, truth, points=4001) for name in METHODS}


def judged(by_method, by_integrator, long):
    """The paper's sentences, each with whether our numbers bear it out."""
    growth = {
        name: curve.largest(0.5, 1.0) / max(curve.largest(0.0, 0.5), FLOOR)
        for name, curve in (long or by_method).items()
    }
    worst = {name: curve.at_steps for name, curve in by_method.items()}
    held = [name for name in growth if name not in ("standard", *PROJECTING)]
    integrators = sorted({name for _, name in by_integrator})
    augmented = {name: by_integrator["augmented", name] for name in integrators}
    largest = {name: curve.largest() for name, curve in augmented.items()}
    seconds = {name: curve.seconds for name, curve in augmented.items()}
    slowest = {
        max(integrators, key=lambda name, m=m: by_integrator[m, name].seconds)
        for m in ("standard", "augmented")
    }
    found = [
        (
            "11",
            "when the standard Lagrange multipliers method is used, the violation of constraints "
            "grows indefinitely with time",
            growth["standard"] > 1.5,
            f"last half over first half {growth['standard']:.2f}",
        ),
        (
            "11",
            "with [baumgarte, augmented, index1, described] the constraints violation does not "
            "growth with time",
            all(growth[name] < 1.5 for name in held),
            ", ".join(f"{name} {growth[name]:.2f}" for name in held),
        ),
        (
            "11",
            "the direct correction approach completely eliminate the violation of constraints",
            worst["described"] < 1e-12,
            f"largest {worst['described']:.1e} m",
        ),
        (
            "13",
            "constrains violation of the augmented lagrangian formulation, the direct correction "
            "approach and the baumgarte stabilization approach have the same order of magnitude",
            worst["described"] > 0.1 * worst["augmented"],
            f"augmented {worst['augmented']:.1e} m, described {worst['described']:.1e} m",
        ),
        (
            "15",
            "the method that most eliminates the constraints violations is the Runge-Kutta",
            min(largest, key=largest.get) == "runge2",
            ", ".join(f"{name} {value:.1e} m" for name, value in largest.items()),
        ),
        (
            "17",
            "the Runge-Kutta integrator (with both methods: standard and augmented) is the less "
            "efficient approach",
            slowest == {"runge2"},
            ", ".join(f"{name} {value:.2f} s" for name, value in seconds.items()),
        ),
    ]
    if "ode" in seconds:
        found.append(
            (
                "17",
                "the ode integrator needs much less time than the Runge-kutta integrator and the "
                "Euler integrator",
                seconds["ode"] < 0.5 * min(seconds["euler"], seconds["runge2"]),
                ", ".join(f"{name} {seconds[name]:.2f} s" for name in ("ode", "euler", "rodas4")),
            )
        )
    heads = ("figure", "sentence", "confirmed", "numbers")
    return [dict(zip(heads, (*each[:2], bool(each[2]), each[3]), strict=True)) for each in found]


def draw(options, by_method, by_integrator, costs, long):
    """Every figure; returns their places."""
    others = {name: curve for name, curve in by_method.items() if name != "standard"}
    costs = {name: row for name, row in costs.items() if name != "minimal"}
    parts = {"one walk": "single", "in a batch": "batch"}
    ratios = {words: {n: row[key] for n, row in costs.items()} for words, key in parts.items()}
    of = {
        method: {name: curve for (m, name), curve in by_integrator.items() if m == method}
        for method in ("augmented", "standard")
    }
    seconds = {m: {name: curve.seconds for name, curve in own.items()} for m, own in of.items()}
    figures = {
        "fig11_violation": each_alone(by_method),
        "fig12_all_methods": all_together(by_method, "All methods"),
        "fig13_without_standard": all_together(others, "All but the standard method"),
        "fig14_time_ratio": bars(ratios, "method", "time by Euler steps, standard = 1", level=1.0),
        "fig15_augmented": all_together(of["augmented"], "Integrators, augmented method"),
        "fig16_standard": all_together(of["standard"], "Integrators, standard method"),
        "fig17_times": bars(seconds, "integrator", "time of a run (s)", log="y"),
    }
    if long:
        figures["hundred_footsteps"] = all_together(long, "A hundred footsteps by rodas4")
    return [options.save(figure, f"{name}.png") for name, figure in figures.items()]


def each_alone(curves):
    columns = 3 if len(curves) < 7 else 4
    rows = -(-len(curves) // columns)
    figure = new_figure(3.0 * columns, 2.4 * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, (name, curve), colour in zip(axes, curves.items(), COLOURS, strict=False):
        ax.plot(curve.t, curve.position, color=colour, linewidth=1.0)
        label(ax, "time (s)", "violation (m)")
        ax.set_title(name, loc="right", fontsize="medium")
        ax.ticklabel_format(axis="y", style="sci", scilimits=(0, 0), useMathText=True)
    for ax in axes[len(curves) :]:
        ax.set_visible(False)
    return figure


def all_together(curves, title):
    linear, logarithmic = new_figure(9.0, 3.8).subplots(1, 2)
    for name, curve in curves.items():
        k = METHODS.index(name) if name in METHODS else list(curves).index(name)
        style = dict(color=COLOURS[k], linestyle=STYLES[k], linewidth=1.1)
        linear.plot(curve.t, curve.position, label=name, **style)
        # The largest violation in each part of the whole time, drawn in the middle of it.
        parts = [p for p in np.array_split(np.arange(len(curve.t)), PARTS) if len(p)]
        tops = [max(curve.position[p].max(), FLOOR) for p in parts]
        logarithmic.plot([curve.t[p].mean() for p in parts], tops, **style)
    label(linear, "time (s)", "violation (m)")
    linear.ticklabel_format(axis="y", style="sci", scilimits=(0, 0), useMathText=True)
    title_of_parts = f"largest in each of {PARTS} parts"
    label(logarithmic, "time (s)", "violation (m)", title_of_parts, log="y")
    linear.figure.suptitle(title, fontsize=10)
    return with_legend(linear)


def bars(heights, x, y, *, level=None, log=""):
    """A bar for each kind of height beside each other, by name."""
    ax = new_figure(7.0, 3.6).subplots()
    for k, (words, own) in enumerate(heights.items()):
        places = np.arange(len(own)) + 0.4 * (k - 0.5)
        drawn = ax.bar(places, list(own.values()), 0.38, color=COLOURS[k], label=words)
        ax.bar_label(drawn, fmt="%.2g", fontsize=8)
        ax.set_xticks(np.arange(len(own)), list(own))
    if level is not None:
        ax.axhline(level, color="#595959", linewidth=0.8)
    label(ax, x, y, log=log)
    ax.margins(y=0.15)
    return with_legend(ax)


def with_legend(ax):
    """The figure of axes, with their legend below."""
    named = ax.get_legend_handles_labels()
    ax.figure.legend(*named, loc="outside lower center", ncols=4, frameon=False)
    return ax.figure


if __name__ == "__main__":
    main()

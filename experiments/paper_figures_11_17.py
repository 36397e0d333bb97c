"""The paper's figures 11 to 17: the hip's violation and its cost, by method and integrator.

Beside each figure the paper's sentence about it, and what our numbers say to it.
"""

from typing import Any

import numpy as np
from _held import (
    COLOURS,
    FLOOR,
    PROJECTING,
    STYLES,
    Curve,
    batch_seconds,
    curve_of,
    truth_of,
)
from _options import Options, parse

import jaxbiped as jb
from jaxbiped.plot._style import dress, new_figure

ODE = jb.Integrator("dopri5", rtol=1e-3)
"""What the paper's "ode" is taken for: Dormand and Prince's pair at MATLAB's usual tolerance."""
STIFF = jb.Integrator("rodas4", rtol=1e-6)
FOOTSTEP = 0.4408


def main() -> None:
    options = parse(__doc__ or "")
    scene = jb.seed_scene()
    quick = options.quick
    step = 1e-5 if quick else 1e-6
    duration = 0.3 if quick else 2.0
    methods = ("standard", "augmented", "described") if quick else tuple(jb.CONSTRAINT_METHODS)
    euler, runge = jb.Integrator("euler", dt=step), jb.Integrator("runge2", dt=step)
    truth = truth_of(scene, duration)
    by_method = {name: curve_of(scene, name, euler, duration, truth) for name in methods}
    tried = {"euler": euler, "runge2": runge} | ({} if quick else {"ode": ODE, "rodas4": STIFF})
    by_integrator = {
        (method, name): by_method[method]
        if name == "euler"
        else curve_of(scene, method, how, duration, truth)
        for method in ("augmented", "standard")
        for name, how in tried.items()
    }
    long = {} if quick else hundred_footsteps(scene)
    costs = costs_of(scene, by_method, long, euler, quick)
    verdicts = judged(by_method, by_integrator, long)
    say(options, by_method, by_integrator, costs, long, verdicts)
    pictures = [
        draw_each(options, by_method),
        draw_all(options, "fig12_all_methods.png", by_method, "All methods"),
        draw_all(
            options,
            "fig13_without_standard.png",
            {name: c for name, c in by_method.items() if name != "standard"},
            "All but the standard method",
        ),
        draw_costs(options, costs),
        draw_integrators(options, "fig15_augmented.png", "augmented", by_integrator),
        draw_integrators(options, "fig16_standard.png", "standard", by_integrator),
        draw_times(options, by_integrator),
    ]
    if long:
        pictures.append(
            draw_all(options, "hundred_footsteps.png", long, "A hundred footsteps by rodas4")
        )
    options.finish(
        {
            "duration_s": duration,
            "dt_s": step,
            "methods": {name: numbers(c) for name, c in by_method.items()},
            "integrators": {f"{m} {i}": numbers(c) for (m, i), c in by_integrator.items()},
            "costs": costs,
            "hundred_footsteps": {name: numbers(c) for name, c in long.items()},
            "verdicts": verdicts,
            "pictures": pictures,
        }
    )


def hundred_footsteps(scene: jb.Scene) -> dict[str, Curve]:
    duration = 100.0 * FOOTSTEP
    truth = truth_of(scene, duration)
    return {
        name: curve_of(scene, name, STIFF, duration, truth, points=4001)
        for name in jb.CONSTRAINT_METHODS
    }


def costs_of(
    scene: jb.Scene,
    by_method: dict[str, Curve],
    long: dict[str, Curve],
    euler: jb.Integrator,
    quick: bool,
) -> dict[str, dict[str, float]]:
    """Times relative to the standard method: one walk, and in a batch, by Euler and by rodas4."""
    count, short = (64, 1e-3) if quick else (1024, 2e-3)
    costs: dict[str, dict[str, float]] = {}
    for name, curve in by_method.items():
        found = {"euler_single": curve.seconds}
        found["euler_batch"] = batch_seconds(scene, name, euler, short, count)
        if not quick:
            found["rodas4_single"] = long[name].seconds
            found["rodas4_batch"] = batch_seconds(scene, name, STIFF, FOOTSTEP, count)
        costs[name] = found
    usual = costs["standard"]
    return {
        name: {key: value / usual[key] for key, value in found.items()}
        for name, found in costs.items()
    }


def numbers(curve: Curve) -> dict[str, Any]:
    return {
        "ending": curve.ending,
        "max_violation_m": curve.at_steps if np.isfinite(curve.at_steps) else None,
        "first_half_m": curve.largest(0.0, 0.5),
        "last_half_m": curve.largest(0.5, 1.0),
        "state_error": curve.error if np.isfinite(curve.error) else None,
        "wall_s_run": curve.seconds,
    }


def judged(
    by_method: dict[str, Curve], by_integrator: dict[tuple[str, str], Curve], long: dict[str, Curve]
) -> list[dict[str, Any]]:
    """The paper's sentences, each with whether our numbers bear it out."""
    curves = long or by_method
    growth = {
        name: c.largest(0.5, 1.0) / max(c.largest(0.0, 0.5), FLOOR) for name, c in curves.items()
    }
    worst = {name: c.at_steps for name, c in by_method.items()}
    held = [name for name in growth if name not in ("standard", *PROJECTING)]
    integrators = sorted({name for _, name in by_integrator})
    augmented = {name: by_integrator["augmented", name] for name in integrators}

    def verdict(figure: str, sentence: str, holds: bool, because: str) -> dict[str, Any]:
        return dict(figure=figure, sentence=sentence, confirmed=bool(holds), numbers=because)

    found = [
        verdict(
            "11",
            "when the standard Lagrange multipliers method is used, the violation of constraints "
            "grows indefinitely with time",
            growth["standard"] > 1.5,
            f"last half over first half {growth['standard']:.2f}",
        ),
        verdict(
            "11",
            "with [baumgarte, augmented, index1, described] the constraints violation does not "
            "growth with time",
            all(growth[name] < 1.5 for name in held),
            ", ".join(f"{name} {growth[name]:.2f}" for name in held),
        ),
        verdict(
            "11",
            "the direct correction approach completely eliminate the violation of constraints",
            worst["described"] < 1e-12,
            f"largest {worst['described']:.1e} m",
        ),
        verdict(
            "13",
            "constrains violation of the augmented lagrangian formulation, the direct correction "
            "approach and the baumgarte stabilization approach have the same order of magnitude",
            worst["described"] > 0.1 * worst["augmented"],
            f"augmented {worst['augmented']:.1e} m, described {worst['described']:.1e} m",
        ),
        verdict(
            "15",
            "the method that most eliminates the constraints violations is the Runge-Kutta",
            min(integrators, key=lambda i: augmented[i].largest(0.0, 1.0)) == "runge2",
            ", ".join(f"{i} {augmented[i].largest(0.0, 1.0):.1e} m" for i in integrators),
        ),
        verdict(
            "17",
            "the Runge-Kutta integrator (with both methods: standard and augmented) is the less "
            "efficient approach",
            all(
                max(integrators, key=lambda i: by_integrator[m, i].seconds) == "runge2"
                for m in ("standard", "augmented")
            ),
            ", ".join(f"{i} {augmented[i].seconds:.2f} s" for i in integrators),
        ),
    ]
    if "ode" in integrators:
        found.append(
            verdict(
                "17",
                "the ode integrator needs much less time than the Runge-kutta integrator and the "
                "Euler integrator",
                augmented["ode"].seconds
                < 0.5 * min(augmented["euler"].seconds, augmented["runge2"].seconds),
                f"ode {augmented['ode'].seconds:.2f} s, euler {augmented['euler'].seconds:.2f} s, "
                f"rodas4 {augmented['rodas4'].seconds:.2f} s",
            )
        )
    return found


def say(
    options: Options,
    by_method: dict[str, Curve],
    by_integrator: dict[tuple[str, str], Curve],
    costs: dict[str, dict[str, float]],
    long: dict[str, Curve],
    verdicts: list[dict[str, Any]],
) -> None:
    for title, curves in (
        ("methods by Euler steps", by_method),
        ("integrators", {f"{m}, {i}": c for (m, i), c in by_integrator.items()}),
        ("a hundred footsteps by rodas4", long),
    ):
        if curves:
            options.say(f"{title}: violation in the first and last half, at steps, error, time")
        for name, curve in curves.items():
            options.say(
                f"  {name:<20} {curve.ending:<14} {curve.largest(0.0, 0.5):.1e} m "
                f"{curve.largest(0.5, 1.0):.1e} m  {curve.at_steps:.1e} m  "
                f"{curve.error:.1e}  {curve.seconds:.3f} s"
            )
    options.say("time relative to the standard method: " + ", ".join(next(iter(costs.values()))))
    for name, row in costs.items():
        options.say(f"  {name:<12}" + "".join(f"{value:>8.2f}" for value in row.values()))
    for each in verdicts:
        word = "confirmed" if each["confirmed"] else "CONTRADICTED"
        options.say(f'figure {each["figure"]}, {word}: "{each["sentence"]}" ({each["numbers"]})')


def draw_each(options: Options, curves: dict[str, Curve]) -> str:
    columns = 3 if len(curves) < 7 else 4
    rows = -(-len(curves) // columns)
    figure = new_figure(3.0 * columns, 2.4 * rows)
    axes = np.ravel(figure.subplots(rows, columns, squeeze=False))
    for k, (name, curve) in enumerate(curves.items()):
        axes[k].plot(curve.t, curve.position, color=COLOURS[k], linewidth=1.0)
        dress(axes[k], name, "time (s)", "violation (m)")
        axes[k].ticklabel_format(axis="y", style="sci", scilimits=(0, 0), useMathText=True)
        axes[k].set_title(name, loc="right", fontsize="medium")
        axes[k].set_title("", loc="left")
    for ax in axes[len(curves) :]:
        ax.set_visible(False)
    return saved(options, figure, "fig11_violation.png")


def draw_all(options: Options, name: str, curves: dict[str, Curve], title: str) -> str:
    figure = new_figure(9.0, 3.8)
    linear, logarithmic = figure.subplots(1, 2)
    names = list(jb.CONSTRAINT_METHODS)
    for method, curve in curves.items():
        k = names.index(method)
        style = dict(color=COLOURS[k], linestyle=STYLES[k], linewidth=1.1)
        linear.plot(curve.t, curve.position, label=method, **style)
        logarithmic.plot(curve.t, np.maximum(curve.position, FLOOR), **style)
    logarithmic.set_yscale("log")
    dress(linear, title, "time (s)", "violation (m)")
    linear.ticklabel_format(axis="y", style="sci", scilimits=(0, 0), useMathText=True)
    linear.set_title("", loc="left")
    dress(logarithmic, "logarithmic", "time (s)", "violation (m)")
    figure.suptitle(title, fontsize=10)
    handles, labels = linear.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=min(len(labels), 4), frameon=False
    )
    return saved(options, figure, name)


def draw_costs(options: Options, costs: dict[str, dict[str, float]]) -> str:
    figure = new_figure(7.0, 3.6)
    ax = figure.subplots()
    keys = list(next(iter(costs.values())))
    width = 0.8 / len(keys)
    for j, key in enumerate(keys):
        places = np.arange(len(costs)) + (j - 0.5 * (len(keys) - 1)) * width
        ax.bar(places, [row[key] for row in costs.values()], width, color=COLOURS[j + 1], label=key)
    ax.set_xticks(np.arange(len(costs)), list(costs))
    ax.axhline(1.0, color="#595959", linewidth=0.8)
    dress(ax, "", "method", "time, standard = 1")
    labels = [key.replace("_", ", ") for key in keys]
    figure.legend(ax.get_legend_handles_labels()[0], labels, loc="outside upper center", ncols=4)
    return saved(options, figure, "fig14_time_ratio.png")


def draw_integrators(
    options: Options, name: str, method: str, curves: dict[tuple[str, str], Curve]
) -> str:
    figure = new_figure(6.4, 3.8)
    ax = figure.subplots()
    mine = {i: c for (m, i), c in curves.items() if m == method}
    for k, (integrator, curve) in enumerate(mine.items()):
        values = np.maximum(curve.position, FLOOR)
        ax.plot(curve.t, values, color=COLOURS[k], linestyle=STYLES[k], label=integrator)
    ax.set_yscale("log")
    dress(ax, f"Integrators, {method} method", "time (s)", "violation (m)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return saved(options, figure, name)


def draw_times(options: Options, curves: dict[tuple[str, str], Curve]) -> str:
    figure = new_figure(6.4, 3.6)
    ax = figure.subplots()
    names = list(dict.fromkeys(name for _, name in curves))
    for k, method in enumerate(("augmented", "standard")):
        seconds = [curves[method, name].seconds for name in names]
        places = np.arange(len(names)) + 0.4 * (k - 0.5)
        ax.bar(places, seconds, 0.38, color=COLOURS[k + 2], label=method)
        for place, value in zip(places, seconds, strict=True):
            ax.annotate(f"{value:.2g}", (place, value), ha="center", va="bottom", fontsize=8)
    ax.set_xticks(np.arange(len(names)), names)
    ax.set_yscale("log")
    ax.margins(y=0.15)
    dress(ax, "Time of the integrators", "integrator", "time of a run (s)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return saved(options, figure, "fig17_times.png")


def saved(options: Options, figure: Any, name: str) -> str:
    path = options.path(name)
    figure.savefig(path, dpi=150)
    return str(path)


if __name__ == "__main__":
    main()

"""Pictures of the hip's violation and of what holding it costs."""

import numpy as np
from _held import COLOURS, FLOOR, STYLES, Curve
from _options import Options

import jaxbiped as jb
from jaxbiped.plot.style import dress, new_figure

PARTS = 100
"""Of a curve that wiggles more often than a picture has room for."""


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
    return options.save(figure, "fig11_violation.png")


def draw_all(options: Options, name: str, curves: dict[str, Curve], title: str) -> str:
    figure = new_figure(9.0, 3.8)
    linear, logarithmic = figure.subplots(1, 2)
    names = list(jb.constraints.CONSTRAINT_METHODS)
    for method, curve in curves.items():
        k = names.index(method)
        style = dict(color=COLOURS[k], linestyle=STYLES[k], linewidth=1.1)
        linear.plot(curve.t, curve.position, label=method, **style)
        logarithmic.plot(*_envelope(curve), **style)
    logarithmic.set_yscale("log")
    dress(linear, title, "time (s)", "violation (m)")
    linear.ticklabel_format(axis="y", style="sci", scilimits=(0, 0), useMathText=True)
    linear.set_title("", loc="left")
    dress(logarithmic, f"largest in each of {PARTS} parts", "time (s)", "violation (m)")
    figure.suptitle(title, fontsize=10)
    handles, labels = linear.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=min(len(labels), 4), frameon=False
    )
    return options.save(figure, name)


def _envelope(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """The largest violation in each part of the whole time, drawn in the middle of it."""
    parts = [p for p in np.array_split(np.arange(len(curve.t)), PARTS) if len(p)]
    middles = np.array([curve.t[p].mean() for p in parts])
    return middles, np.array([max(curve.position[p].max(), FLOOR) for p in parts])


def draw_costs(options: Options, costs: dict[str, dict[str, float]]) -> str:
    figure = new_figure(7.0, 3.6)
    ax = figure.subplots()
    shown = {name: row for name, row in costs.items() if name != "minimal"}
    for j, (key, label) in enumerate({"single": "one walk", "batch": "in a batch"}.items()):
        places = np.arange(len(shown)) + 0.4 * (j - 0.5)
        ax.bar(
            places, [row[key] for row in shown.values()], 0.38, color=COLOURS[j + 1], label=label
        )
    ax.set_xticks(np.arange(len(shown)), list(shown))
    ax.axhline(1.0, color="#595959", linewidth=0.8)
    dress(ax, "", "method", "time by Euler steps, standard = 1")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return options.save(figure, "fig14_time_ratio.png")


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
    return options.save(figure, name)


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
    return options.save(figure, "fig17_times.png")

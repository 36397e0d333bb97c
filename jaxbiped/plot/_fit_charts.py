"""Charts of what a search for parameters came to: a fit to measured gaits, an optimisation."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._quantity import Quantity
from jaxbiped.continuation._branch import Branch
from jaxbiped.gait._gait import QUANTITIES
from jaxbiped.identify._gait_fit import GaitFit
from jaxbiped.identify._measured_gait import MEASURES, MeasuredGait
from jaxbiped.optimise._optimum import Optimum
from jaxbiped.plot import style
from jaxbiped.plot._symbols import quantity_of
from jaxbiped.scene._parameter_access import parameter_quantities, parameter_values

_KEPT = 1e-6
"""Relative amount by which a requirement may be missed that counts as kept."""


def fit(fitted: GaitFit) -> Figure:
    """Draws the estimates of a fit with their intervals, and its residuals.

    Above, each estimate with its 95 % interval (thin) and its standard error (thick), relative to
    the estimate, and in numbers above it. An open end is drawn at 100 %. A parameter that the data
    do not determine, or that is at a bound, has no bars. Below, (predicted − measured) over the
    standard deviation of each number measured; about 95 % of them lie within the shaded band if the
    model and the deviations are right.

    Args:
        fitted: a fit from `fit_gait`.

    Returns:
        A new figure.

    Raises:
        ArgumentError: `fitted` is not a `GaitFit`.
    """
    check_type("fitted", fitted, GaitFit)
    names = list(fitted.estimates)
    tall = 0.7 + 0.42 * len(names), 1.9
    figure = style.new_figure(6.8, sum(tall) + 0.5, rows=True)
    upper, lower = figure.subplots(2, 1, height_ratios=tall)
    _draw_estimates(upper, fitted, names)
    count = np.arange(1, len(fitted.residuals) + 1)
    lower.axhspan(-1.96, 1.96, color=style.SHADE_COLOUR, alpha=0.6, linewidth=0)
    lower.axhline(0.0, color=style.GROUND_COLOUR, linewidth=0.8)
    lower.vlines(count, 0.0, fitted.residuals, color=style.LEG_COLOURS[0], linewidth=1.2)
    lower.plot(count, fitted.residuals, "o", color=style.LEG_COLOURS[0], markersize=4)
    lower.xaxis.set_major_locator(MaxNLocator(integer=True))
    lower.margins(y=0.1)
    words = "number measured, as given (–)", r"residual, in $\sigma$ (–)"
    style.dress(lower, _chi_squared(fitted), *words)
    return figure


def _chi_squared(fitted: GaitFit) -> str:
    return rf"$\chi^2$ = {fitted.chi_squared:.3g}, {fitted.freedom} degrees of freedom"


def _draw_estimates(ax: Axes, fitted: GaitFit, names: list[str]) -> None:
    places = np.arange(len(names))
    values = np.array([fitted.estimates[name] for name in names])
    errors = np.array([fitted.standard_errors[name] for name in names])
    ends = np.array([fitted.intervals[name] for name in names]).reshape(-1, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = np.where(values == 0.0, np.nan, 100.0 / values)
    reach = np.sort((ends - values[:, None]) * percent[:, None], axis=1)
    reach[np.isinf(reach)] = np.sign(reach[np.isinf(reach)]) * 100.0
    look: dict[str, Any] = {"color": style.LEG_COLOURS[0]}
    ax.hlines(places, *reach.T, linewidth=1.0, label="95 % interval", **look)
    deviations = np.abs(errors * percent)
    ax.hlines(places, -deviations, deviations, linewidth=3.5, label="standard error", **look)
    ax.plot(np.zeros(len(names)), places, "o", markersize=5, **look)
    ax.axvline(0.0, color=style.GROUND_COLOUR, linewidth=0.8, zorder=0.5)
    quantities = [
        (quantity_of(name) or Quantity(name))._replace(unit=fitted.units[name]) for name in names
    ]
    short = style.is_narrow() and len({each.symbol for each in quantities} - {""}) == len(names)
    ax.set_yticks(places, [each.symbol if short else each.in_row() for each in quantities])
    ax.set_ylim(len(names) - 0.6, -0.8)
    for place, quantity, name, value, error in zip(
        places, quantities, names, values, errors, strict=True
    ):
        text = f"{_with_error(value, error)} {quantity.unit_in_figure}".removesuffix(" –")
        if name in fitted.undetermined:
            text += ", undetermined"
        elif name in fitted.one_sided:
            text += ", limited on one side"
        elif name in fitted.at_bounds:
            text += ", at a bound"
        style.label_point(ax, text, (0.0, float(place)), (0, 6), ha="center", va="bottom")
    style.dress(ax, "", "interval relative to the estimate (%)", "")
    ax.spines["left"].set_visible(False)
    ax.tick_params(axis="y", length=0)
    style.legend(ax, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)


def _with_error(value: float, error: float) -> str:
    """A value to two digits of its error, and that."""
    if not (0.0 < error < np.inf):
        return f"{value:.5g}"
    digits = max(1, 2 + math.floor(math.log10(abs(value or error))) - math.floor(math.log10(error)))
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    exponent = int(power)
    if -4 <= exponent < 6:
        decimals = max(0, digits - 1 - exponent)
        return f"{value:.{decimals}f} ± {error:.{decimals}f}"
    return rf"({mantissa} ± {error / 10.0**exponent:.{digits - 1}f}) $\times 10^{{{exponent}}}$"


def fit_data(
    fitted: GaitFit, measured: MeasuredGait | Sequence[MeasuredGait], branch: Branch
) -> Figure:
    """Draws measured gaits over the condition under which they were measured, and the fitted model.

    There is a panel for each measure. Error bars are one standard deviation; the line is the model,
    dashed where its gaits are not stable. Angles over time are not drawn.

    Args:
        fitted: a fit from `fit_gait`.
        measured: the measured gaits.
        branch: gaits of the fitted walker along the condition, from `continue_gait` and the scene
            with the estimates.

    Returns:
        A new figure.

    Raises:
        ArgumentError: no measure was given, or the branch has no points, is not that of the fitted
            walker, or has another number of footsteps or other conditions than a measured gait.
    """
    check_type("fitted", fitted, GaitFit)
    check_type("branch", branch, Branch)
    gaits = [measured] if isinstance(measured, MeasuredGait) else list(measured)
    pairs = [(_place_along(branch, fitted, gait), gait.measures) for gait in gaits]
    names = [name for name in MEASURES if any(name in gait.measures for gait in gaits)]
    if not names or not len(branch):
        raise ArgumentError("measured and branch must hold at least one measure and one gait.")
    columns = style.panels_abreast(min(len(names), 2), width=2.9)
    figure = style.new_figure(max(4.2 * columns, 5.6), 0.6 + 2.6 * -(-len(names) // columns))
    along = parameter_quantities(branch.scene)[branch.along]
    panels = _panels(figure, len(names), columns, along.on_axis())
    dataset, stable = branch.to_dataset(), [gait is not False for gait in branch.stable]
    look: dict[str, Any] = {"color": style.LEG_COLOURS[1], "linewidth": 1.4}
    bars: dict[str, Any] = {"color": style.LEG_COLOURS[0], "markersize": 4, "capsize": 2.5}
    for ax, name in zip(panels, names, strict=True):
        model = dataset[name].values
        ax.plot(branch.values, model, linestyle=(0, (5, 2)), **look)
        ax.plot(branch.values, np.where(stable, model, np.nan), label="model", **look)
        x, y, errors = zip(*((at, *seen[name]) for at, seen in pairs if name in seen), strict=True)
        ax.errorbar(x, y, errors, fmt="o", label="measured", zorder=3, **bars)
        style.dress(ax, "", ax.get_xlabel(), QUANTITIES[name].on_axis())
    if branch.axis.log:
        panels[0].set_xscale("log")
    style.set_title(panels[0], _chi_squared(fitted))
    style.legend_of_figure(figure, panels[0].get_legend_handles_labels()[0])
    return figure


def _place_along(branch: Branch, fitted: GaitFit, gait: MeasuredGait) -> float:
    """The value of a branch's parameter at which a gait was measured, if the branch is its own."""
    check_type("measured", gait, MeasuredGait)
    values = {name: float(x) for name, x in parameter_values(branch.scene).items()}
    wanted = fitted.estimates | dict(gait.conditions)
    place = wanted.pop(branch.along, values[branch.along])
    for name, value in wanted.items():
        if not math.isclose(value, values.get(name, math.nan), rel_tol=1e-9):
            raise ArgumentError(
                f"branch is not allowed: its {name} is {values.get(name)}, and that of the fit or "
                f"of a measured gait is {value:.6g}."
            )
    if gait.footsteps not in (None, branch.footsteps):
        raise ArgumentError(
            f"branch is not allowed: its cycles have {branch.footsteps} footsteps, and a measured "
            f"gait has {gait.footsteps}."
        )
    return place


def optimisation(optimum: Optimum) -> Figure:
    """Draws how an optimisation went: objective, measures and variables of each iterate.

    A panel for each, with its own unit. Open marks are designs that miss a requirement; dashed
    lines are bounds that hold the optimum; the star is the optimum, with its error bar. Iterates
    of several runs follow one another.

    Args:
        optimum: an optimum from `optimise_gait`.

    Returns:
        A new figure.

    Raises:
        ArgumentError: the optimum has no iterates.
    """
    check_type("optimum", optimum, Optimum)
    history = optimum.history
    if not history:
        raise ArgumentError("optimum has no history: there is no iterate to draw.")
    rows = _rows(optimum)
    columns = style.panels_abreast(1 if len(rows) < 4 else 2, width=2.9)
    tall = 0.8 + 1.35 * -(-len(rows) // columns)
    figure = style.new_figure(3.8 * max(columns, 1.6), tall, rows=True)
    panels = _panels(figure, len(rows), columns, "iterate (–)")
    kept = np.array([each.excess <= _KEPT for each in history])
    # The iterate that the optimum is, or the last one.
    same = [k for k, each in enumerate(history) if each.variables == optimum.variables]
    best = same[-1] if same else len(history) - 1
    for ax, (quantity, values, value, error, bound) in zip(panels, rows, strict=True):
        _draw_row(ax, np.array(values), kept, best, (value, error), bound)
        y_label = f"{quantity.symbol or quantity.words} ({quantity.unit_in_figure})"
        style.dress(ax, quantity.words, ax.get_xlabel(), y_label, panel=True)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=5))
    bounds = any(row[4] is not None for row in rows)
    style.legend_of_figure(figure, _legend(kept, bounds))
    return figure


def _panels(figure: Figure, count: int, columns: int, label: str) -> list[Axes]:
    """So many panels in columns that share an axis, whose label only the lowest ones have."""
    lines = -(-count // columns)
    panels = list(figure.subplots(lines, columns, squeeze=False, sharex=True).flat)
    for ax in panels[count:]:
        ax.set_axis_off()
    for ax in panels[max(count - columns, 0) : count]:
        ax.set_xlabel(label)
        ax.tick_params(labelbottom=True)
    return panels[:count]


_Row = tuple[Quantity, list[float], float, float, float | None]
"""What it is, its value at each iterate, that of the optimum and its error, a bound that holds."""


def _rows(optimum: Optimum) -> list[_Row]:
    history, known = optimum.history, optimum.known
    held = {
        each.name: each.bound
        for each in (*optimum.optimality.requirements, *optimum.optimality.bounds)
        if each.active
    }
    values = [each.objective for each in history]
    measures = {name: [each.measures[name] for each in history] for name in history[0].measures}
    # One measure alone is the objective itself: its name and its unit are known.
    alone = [name for name, own in measures.items() if np.array_equal(own, values)]
    quantity = optimum.quantities[alone[0]] if alone else Quantity("objective", unit="SI")
    rows: list[_Row] = [(quantity, values, optimum.objective, optimum.error, None)]
    for name, own in measures.items():
        if name not in alone:
            told = known.values[name], known.errors[name]
            rows.append((optimum.quantities[name], own, *told, held.get(name)))
    quantities = parameter_quantities(optimum.scene)
    for name, value in optimum.variables.items():
        own = [each.variables[name] for each in history]
        rows.append((quantities[name], own, value, 0.0, held.get(name)))
    return rows


def _draw_row(
    ax: Axes,
    values: np.ndarray,
    kept: np.ndarray,
    best: int,
    told: tuple[float, float],
    bound: float | None,
) -> None:
    numbers, colour = np.arange(len(values)), style.LEG_COLOURS[0]
    ax.plot(numbers, values, color=colour, linewidth=1.0)
    ax.plot(numbers[kept], values[kept], "o", color=colour, markersize=4)
    missed: dict[str, Any] = {"markerfacecolor": "white", "color": colour, "markersize": 4}
    ax.plot(numbers[~kept], values[~kept], "o", **missed)
    star: dict[str, Any] = {"color": style.LEG_COLOURS[1], "markersize": 9, "capsize": 3.0}
    ax.errorbar([best], [told[0]], [told[1]], fmt="*", zorder=4, label="optimum", **star)
    if bound is not None:
        ax.axhline(bound, color=style.GROUND_COLOUR, linestyle=(0, (4, 2)), linewidth=0.9)
    ax.margins(y=0.15)


def _legend(kept: np.ndarray, held: bool) -> list[Line2D]:
    look: dict[str, Any] = {"color": style.LEG_COLOURS[0], "marker": "o", "markersize": 4}
    entries = [Line2D([], [], label="iterate", **look)]
    if not kept.all():
        look |= {"markerfacecolor": "white"}
        entries.append(Line2D([], [], label="misses a requirement", **look))
    star: dict[str, Any] = {"color": style.LEG_COLOURS[1], "marker": "*", "linestyle": "none"}
    entries.append(Line2D([], [], label="optimum", markersize=9, **star))
    if held:
        dashes: dict[str, Any] = {"color": style.GROUND_COLOUR, "linestyle": (0, (4, 2))}
        entries.append(Line2D([], [], label="bound that holds it", **dashes))
    return entries

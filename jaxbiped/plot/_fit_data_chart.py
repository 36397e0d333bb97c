"""Chart of measured gaits over a condition, beside the model that was fitted to them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped.continuation._branch import Branch
from jaxbiped.gait._gait import QUANTITIES
from jaxbiped.identify._gait_fit import GaitFit
from jaxbiped.identify._measured_gait import MEASURES, MeasuredGait
from jaxbiped.plot import style
from jaxbiped.scene._parameter_access import parameter_quantities, parameter_values


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
    places = [_place_along(branch, fitted, gait) for gait in gaits]
    names = [name for name in MEASURES if any(name in gait.measures for gait in gaits)]
    if not names or not len(branch):
        raise ArgumentError("measured and branch must hold at least one measure and one gait.")
    columns = style.panels_abreast(min(len(names), 2), width=2.9)
    lines = -(-len(names) // columns)
    figure = style.new_figure(max(4.2 * columns, 5.6), 0.6 + 2.6 * lines)
    panels = list(figure.subplots(lines, columns, squeeze=False, sharex=True).flat)
    dataset, stable = branch.to_dataset(), [gait is not False for gait in branch.stable]
    look: dict[str, Any] = {"color": style.LEG_COLOURS[1], "linewidth": 1.4}
    bars: dict[str, Any] = {"color": style.LEG_COLOURS[0], "markersize": 4, "capsize": 2.5}
    for ax, name in zip(panels, names, strict=False):
        model = dataset[name].values
        ax.plot(branch.values, model, linestyle=(0, (5, 2)), **look)
        ax.plot(branch.values, np.where(stable, model, np.nan), label="model", **look)
        pairs = zip(places, (gait.measures for gait in gaits), strict=True)
        rows = [(x, *measures[name]) for x, measures in pairs if name in measures]
        ax.errorbar(*zip(*rows, strict=True), fmt="o", label="measured", zorder=3, **bars)
        style.dress(ax, "", "", QUANTITIES[name].on_axis())
    for ax in panels[len(names) :]:
        ax.set_axis_off()
    for ax in panels[max(len(names) - columns, 0) : len(names)]:
        ax.set_xlabel(parameter_quantities(branch.scene)[branch.along].on_axis())
        ax.tick_params(labelbottom=True)
    if branch.axis.log:
        panels[0].set_xscale("log")
    numbers = rf"$\chi^2$ = {fitted.chi_squared:.3g}, {fitted.freedom} degrees of freedom"
    style.set_title(panels[0], numbers)
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

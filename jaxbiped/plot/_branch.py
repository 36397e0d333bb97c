"""Branches of gaits along a parameter, and curves of their bifurcations in two."""

from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._quantity import Quantity
from jaxbiped.continuation._bifurcation_curve import BifurcationCurve
from jaxbiped.continuation._bifurcations import BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import BranchPoint
from jaxbiped.dynamics._state_quantities import STATE_QUANTITIES, recurring_names
from jaxbiped.plot import style
from jaxbiped.plot._symbols import NORMAL_FORCE
from jaxbiped.scene._parameter_access import parameter_quantities

_MEASURES = {
    "period": Quantity("time of a footstep", r"$T$", "s"),
    "step_length": Quantity("step length", r"$L$", "m"),
    "speed": Quantity("speed", r"$v$", "m/s"),
    "peak_normal": NORMAL_FORCE._replace(words="largest normal force"),
    "spectral_radius": Quantity("spectral radius of a cycle", r"$\rho$"),
}
_STYLES: dict[bool | None, Any] = {True: "-", False: (0, (5, 2)), None: (0, (1, 1.5))}
_WORDS = {True: "stable", False: "unstable", None: "undecided"}
_MARKS = {
    BranchEvent.FOLD: ("s", "fold"),
    BranchEvent.PERIOD_DOUBLING: ("D", "period doubling"),
    BranchEvent.NEIMARK_SACKER: ("^", "Neimark–Sacker"),
    BranchEvent.BRANCH_POINT: ("P", "branch point"),
    BranchEvent.LIMIT: ("X", "limit of the model"),
    BranchEvent.NOT_LOCATED: ("*", "bifurcation, not located"),
}


def branch(
    branches: Branch | Sequence[Branch], measure: str = "step_length", *, ax: Axes | None = None
) -> Figure:
    """Draws a measure of the gaits on one branch or several over the parameter.

    Stable gaits are solid lines, unstable ones dashed, and dotted those whose stability the
    multipliers' errors leave open. Colours tell the footsteps of a cycle, marks the bifurcations.
    Period and step length are those of a footstep, on average over the cycle.

    Args:
        branches: of one scene along one parameter.
        measure: "period", "step_length", "speed", "peak_normal", "spectral_radius" or a component
            of the state, such as "theta_2".
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: an unknown measure, branches along several parameters, or without points.
    """
    given = [branches] if isinstance(branches, Branch) else list(branches)
    if not given or not all(len(each) for each in given):
        raise ArgumentError("branches is not allowed: each must have a point.")
    if len({each.along for each in given}) > 1:
        raise ArgumentError("branches is not allowed: they must go along one parameter.")
    components = recurring_names(given[0].state_type)
    check_choice("measure", measure, (*_MEASURES, *components))
    ax = style.axes_or_new(ax, 6.8, 4.6)
    counts = sorted({each.footsteps for each in given})
    for each in given:
        _draw_lines(ax, each, measure, style.colour_of(counts.index(each.footsteps)))
    drawn = {kind for kind in _MARKS for each in given if _draw_marks(ax, each, measure, kind)}
    kinds = [kind for kind in _MARKS if kind in drawn]
    if given[0].axis.log:
        ax.set_xscale("log")
    if measure == "spectral_radius":
        ax.axhline(1.0, color=style.GROUND_COLOUR, linewidth=0.6, zorder=0.5)
    quantity = _MEASURES.get(measure) or STATE_QUANTITIES[measure]
    along = parameter_quantities(given[0].scene)[given[0].along]
    style.dress(ax, f"Gaits along {along.words}", along.on_axis(), quantity.on_axis())
    _legend(ax, given, kinds, counts)
    return style.figure_of(ax)


def bifurcation_curves(curves: Sequence[BifurcationCurve], *, ax: Axes | None = None) -> Figure:
    """Draws curves of bifurcations in the plane of two parameters.

    Args:
        curves: along the same two parameters.
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: no curve, or curves along other parameters.
    """
    if len({(each.along, each.units) for each in curves}) != 1:
        raise ArgumentError("curves is not allowed: they must go along the same two parameters.")
    ax = style.axes_or_new(ax, 6.4, 4.4)
    for k, curve in enumerate(curves):
        marker, words = _MARKS[curve.kind]
        first, second = curve.values.T
        ax.plot(
            second, first, marker=marker, markersize=3.5, color=style.colour_of(k),
            linewidth=1.2, label=words,
        )  # fmt: skip
    seconds = np.concatenate([curve.values[:, 1] for curve in curves])
    if seconds.min() > 0.0 and seconds.max() > 10.0 * seconds.min():
        ax.set_xscale("log")
    names, units = curves[0].along, curves[0].units
    labels = [Quantity(name, unit=unit).on_axis() for name, unit in zip(names, units, strict=True)]
    style.dress(ax, "Where gaits lose their stability", labels[1], labels[0])
    style.legend(ax)
    return style.figure_of(ax)


def _value(measure: str, each: Branch, point: BranchPoint) -> float:
    if measure == "spectral_radius":
        return float(np.abs(point.multipliers[0]))
    if measure == "speed":
        return point.step_length / point.period
    if measure in ("period", "step_length"):
        return float(getattr(point, measure)) / each.footsteps
    if measure == "peak_normal":
        return point.peak_normal
    place = each.state_type._fields.index(measure) - 1  # type: ignore[attr-defined]
    return float(point.recurring[place])


def _draw_lines(ax: Axes, each: Branch, measure: str, colour: str) -> None:
    """Lines between neighbours; a bifurcation belongs to the gaits on either side of it."""
    special = {point.point.value for point in each.bifurcations}
    values = [(point.value, _value(measure, each, point)) for point in each.points]
    kinds: list[bool | None] = []
    for here, there in pairwise(each.points):
        inner = there if here.value in special else here
        kinds.append(inner.stable)
    if not kinds:
        ax.plot(*values[0], ".", color=colour)
    for kind, group in groupby(range(len(kinds)), key=lambda k: kinds[k]):
        parts = list(group)
        x, y = zip(*values[parts[0] : parts[-1] + 2], strict=True)
        ax.plot(x, y, color=colour, linestyle=_STYLES[kind], linewidth=1.3)


def _draw_marks(ax: Axes, each: Branch, measure: str, kind: BranchEvent) -> bool:
    points = [event.point for event in each.bifurcations if event.kind is kind]
    for point in points:
        ax.plot(
            point.value, _value(measure, each, point), _MARKS[kind][0], color=style.GROUND_COLOUR,
            markersize=6, zorder=3,
        )  # fmt: skip
    return bool(points)


def _legend(ax: Axes, given: list[Branch], kinds: list[BranchEvent], counts: list[int]) -> None:
    known = [kind for kind in _WORDS if any(kind in each.stable for each in given)]
    decided = [kind for kind in known if kind is not None or _is_drawn_undecided(given)]
    handles = [
        Line2D([], [], color=style.GROUND_COLOUR, linestyle=_STYLES[kind], label=_WORDS[kind])
        for kind in decided
    ]
    if len(counts) > 1:
        handles += [
            Line2D([], [], color=style.colour_of(k), label=_footsteps(count))
            for k, count in enumerate(counts)
        ]
    handles += [
        Line2D([], [], color=style.GROUND_COLOUR, marker=_MARKS[kind][0], linestyle="none",
               label=_MARKS[kind][1])
        for kind in kinds
    ]  # fmt: skip
    style.legend_below(ax, columns=min(len(handles), 5), handles=handles)


def _footsteps(count: int) -> str:
    return "1 footstep" if count == 1 else f"{count} footsteps"


def _is_drawn_undecided(given: list[Branch]) -> bool:
    """Whether gaits besides bifurcations are undecided."""
    special = {(id(each), event.point.value) for each in given for event in each.bifurcations}
    return any(
        point.stable is None and (id(each), point.value) not in special
        for each in given
        for point in each.points
    )

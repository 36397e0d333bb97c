"""Charts of branches of gaits along a parameter, and of curves of bifurcations in two."""

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped._quantity import Quantity
from jaxbiped.continuation._bifurcation_curve import BifurcationCurve
from jaxbiped.continuation._bifurcations import BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import BranchPoint, CycleFootsteps
from jaxbiped.continuation._switch_branch import DoublingCascade
from jaxbiped.dynamics._state import recurring_names, state_quantity
from jaxbiped.gait._search_provenance import BranchEnd
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
EVENT_MARKS = {
    BranchEvent.FOLD: ("s", "fold"),
    BranchEvent.PERIOD_DOUBLING: ("D", "period doubling"),
    BranchEvent.NEIMARK_SACKER: ("^", "Neimark–Sacker"),
    BranchEvent.BRANCH_POINT: ("P", "branch point"),
    BranchEvent.LIMIT: ("X", "limit of the model"),
    BranchEvent.NOT_LOCATED: ("*", "bifurcation, not located"),
}


def branch(
    branches: Branch | Sequence[Branch] | DoublingCascade,
    measure: str = "step_length",
    *,
    ax: Axes | None = None,
) -> Figure:
    """Draws a measure of the gaits on one branch or several over the parameter.

    A cycle of several footsteps has a line for each of them, which begins where the branch of half
    as many footsteps doubles its period, if that branch is drawn too. Lines are solid for stable
    gaits, dashed for unstable ones, and dotted if the multipliers' errors leave the stability open.
    The colour and width of a line show the number of footsteps of a cycle; marks show bifurcations.
    The spectral radius has a band of its errors and a line at radius 1. If a compliant walker's
    legs are unequal, period and step length are averages over the two footsteps of a stride.

    Args:
        branches: one or several branches of one scene along one parameter, or the result of
            `jaxbiped.continuation.doubling_cascade`.
        measure: "period", "step_length", "speed", "peak_normal", "spectral_radius" or a component
            of the state, such as "theta_2".
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: the measure is unknown, or branches are along several parameters or without
            points.
    """
    given = _branches_of(branches)
    for each in given:
        check_type("branches", each, Branch)
    if not given or not all(len(each) for each in given):
        raise ArgumentError("branches is not allowed: each must have a point.")
    if len({each.along for each in given}) > 1:
        raise ArgumentError("branches is not allowed: they must go along one parameter.")
    components = recurring_names(given[0].state_type)
    check_choice("measure", measure, (*_MEASURES, *components))
    ax = style.axes_or_new(ax, 6.8, 4.6)
    counts = sorted({each.footsteps for each in given})
    for each in given:
        begin = _doubling_of(each, given, measure)
        _draw_lines(ax, each, measure, begin, _look(counts.index(each.footsteps)))
    for each in given:
        for event in each.bifurcations:
            size = 6 * 0.75 ** counts.index(each.footsteps)
            look: dict[str, Any] = {"color": style.GROUND_COLOUR, "markersize": size, "zorder": 3}
            for height in _values(measure, each, event.point):
                ax.plot(event.value, height, EVENT_MARKS[event.kind][0], **look)
    if given[0].axis.log:
        ax.set_xscale("log")
    if measure == "spectral_radius":
        for each in given:
            _draw_errors(ax, each, style.colour_of(counts.index(each.footsteps)))
        ax.axhline(1.0, color="black", linewidth=0.9, zorder=0.5, label="radius 1")
    quantity = _MEASURES.get(measure) or state_quantity(measure) or Quantity(measure, "", "SI")
    along = parameter_quantities(given[0].scene)[given[0].along]
    style.dress(ax, f"Gaits along {along.words}", along.on_axis(), quantity.on_axis())
    handles = [*_entries(given, counts), *ax.get_legend_handles_labels()[0]]
    style.legend_below(ax, columns=min(len(handles), 5), handles=handles)
    return style.figure_of(ax)


def bifurcation_curves(curves: Sequence[BifurcationCurve], *, ax: Axes | None = None) -> Figure:
    """Draws curves of bifurcations in the plane of two parameters.

    Args:
        curves: one or several curves along the same two parameters.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: there is no curve, or curves are along different parameters.
    """
    if len({(each.along, each.units) for each in curves}) != 1:
        raise ArgumentError(
            "curves must hold at least one curve, all along the same two parameters."
        )
    ax = style.axes_or_new(ax, 6.4, 4.4)
    for k, curve in enumerate(curves):
        marker, words = EVENT_MARKS[curve.kind]
        first, second = curve.values.T
        look = style.line_of(k) | {"markersize": 3.5, "linewidth": 1.2}
        ax.plot(second, first, marker=marker, label=words, **look)
    seconds = np.concatenate([curve.values[:, 1] for curve in curves])
    if seconds.min() > 0.0 and seconds.max() > 10.0 * seconds.min():
        ax.set_xscale("log")
    names, units = curves[0].along, curves[0].units
    labels = [Quantity(name, unit=unit).on_axis() for name, unit in zip(names, units, strict=True)]
    style.dress(ax, "Where gaits lose their stability", labels[1], labels[0])
    style.legend(ax)
    return style.figure_of(ax)


def _branches_of(branches: Any) -> list[Branch]:
    if isinstance(branches, DoublingCascade):
        branches = branches.branches
    return [*branches] if isinstance(branches, list | tuple) else [branches]


def _values(measure: str, each: Branch, point: BranchPoint) -> np.ndarray:
    """The measure of each footstep of a gait; the spectral radius is that of the cycle."""
    if measure == "spectral_radius":
        return np.abs(point.multipliers[:1])
    whole = point.recurring, point.period, point.step_length, point.peak_normal
    steps = point.footsteps or CycleFootsteps(*(np.array([value]) for value in whole))
    if measure == "speed":
        return steps.step_length / steps.period
    if measure in ("period", "step_length"):
        values: np.ndarray = getattr(steps, measure)
        return values * len(values) / each.footsteps
    if measure == "peak_normal":
        return steps.peak_normal
    return steps.recurring[:, recurring_names(each.state_type).index(measure)]


def _doubling_of(
    child: Branch, given: list[Branch], measure: str
) -> tuple[float, np.ndarray] | None:
    """The parameter and the measure at the period doubling from which a branch comes."""
    stop = child.stops[0]
    for each in given:
        for event in each.bifurcations:
            is_parent = event.kind is BranchEvent.PERIOD_DOUBLING and event.value == stop.value
            if is_parent and stop.end is BranchEnd.BRANCHES_OFF:
                return event.value, _values(measure, each, event.point)
    return None


def _look(k: int) -> dict[str, Any]:
    """Of the lines of the k-th number of footsteps: thinner ones for more of them."""
    return {"color": style.colour_of(k), "linewidth": max(0.8, 1.6 * 0.75**k)}


def _draw_errors(ax: Axes, each: Branch, colour: str) -> None:
    """A band of the leading multiplier's errors, where they are known."""
    values = np.array([point.value for point in each.points])
    sizes = np.array([np.abs(point.multipliers[0]) for point in each.points])
    errors = np.array([point.multiplier_errors[0] for point in each.points])
    errors = np.where(np.isfinite(errors), errors, np.nan)
    look: dict[str, Any] = {"color": colour, "alpha": 0.25, "linewidth": 0.0, "zorder": 0.8}
    ax.fill_between(values, sizes - errors, sizes + errors, **look)


def _draw_lines(
    ax: Axes,
    each: Branch,
    measure: str,
    begin: tuple[float, np.ndarray] | None,
    look: dict[str, Any],
) -> None:
    """Lines between neighbours; a bifurcation belongs to the gaits on either side of it."""
    special = {point.point.value for point in each.bifurcations}
    x = [point.value for point in each.points]
    rows = [_values(measure, each, point) for point in each.points]
    kinds = [
        (there if here.value in special else here).stable for here, there in pairwise(each.points)
    ]
    if begin is not None:  # Footsteps of a doubled cycle follow those of the cycle twice over.
        x, rows = [begin[0], *x], [np.resize(begin[1], len(rows[0])), *rows]
        kinds = [each.points[0].stable, *kinds]
    if not kinds:
        ax.plot(x * len(rows[0]), rows[0], "o", color=look["color"], markersize=4)
    for kind, group in groupby(range(len(kinds)), key=kinds.__getitem__):
        first, *others = group
        part = slice(first, first + len(others) + 2)
        for y in np.transpose(rows[part]):
            ax.plot(x[part], y, linestyle=_STYLES[kind], **look)


def _entries(given: list[Branch], counts: list[int]) -> Iterator[Line2D]:
    """Of the legend: kinds of stability, footsteps of cycles where they differ, bifurcations."""
    grey = style.GROUND_COLOUR
    stable = {kind for each in given for kind in each.stable}
    if None in stable and not any(map(_is_undecided, given)):
        stable.remove(None)
    for kind in (kind for kind in _WORDS if kind in stable):
        yield Line2D([], [], color=grey, linestyle=_STYLES[kind], label=_WORDS[kind])
    for k, count in enumerate(counts) if len(counts) > 1 else ():
        words = f"{count} footstep{'s' * (count > 1)}"
        yield Line2D([], [], label=words, **_look(k))
    drawn = {event.kind for each in given for event in each.bifurcations}
    for event, (marker, words) in EVENT_MARKS.items():
        if event in drawn:
            yield Line2D([], [], color=grey, marker=marker, linestyle="none", label=words)


def _is_undecided(each: Branch) -> bool:
    """Whether gaits besides bifurcations are undecided."""
    special = {event.point.value for event in each.bifurcations}
    return any(point.stable is None and point.value not in special for point in each.points)

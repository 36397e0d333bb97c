"""Along a parameter: branches of gaits and fractions of basins; in two, curves of bifurcations."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jaxbiped._checks import ArgumentError, check_choice, check_finite, check_positive, check_type
from jaxbiped._quantity import Quantity
from jaxbiped.basins._label_statistics import Fraction, wilson_interval
from jaxbiped.continuation._bifurcation_curve import BifurcationCurve
from jaxbiped.continuation._bifurcations import BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import BranchPoint, CycleFootsteps
from jaxbiped.continuation._switch_branch import DoublingCascade
from jaxbiped.dynamics._state import recurring_names, state_quantity
from jaxbiped.gait._search_provenance import BranchEnd
from jaxbiped.plot import style
from jaxbiped.plot._symbols import NORMAL_FORCE, axis_label
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
    given: Any = branches.branches if isinstance(branches, DoublingCascade) else branches
    given = [*given] if isinstance(given, list | tuple) else [given]
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
    for curve in given:
        k = counts.index(curve.footsteps)
        _draw_lines(ax, curve, given, measure, _look(k))
        look: dict[str, Any] = {"color": style.GROUND_COLOUR, "markersize": 6 * 0.75**k}
        for event in curve.bifurcations:
            for height in _values(measure, curve, event.point):
                ax.plot(event.value, height, EVENT_MARKS[event.kind][0], zorder=3, **look)
    if given[0].axis.log:
        ax.set_xscale("log")
    if measure == "spectral_radius":
        for curve in given:
            _draw_errors(ax, curve, style.colour_of(counts.index(curve.footsteps)))
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


def _values(measure: str, curve: Branch, point: BranchPoint) -> np.ndarray:
    """The measure of each footstep of a gait; the spectral radius is that of the cycle."""
    if measure == "spectral_radius":
        return np.abs(point.multipliers[:1])
    whole = point.recurring, point.period, point.step_length, point.peak_normal
    steps = point.footsteps or CycleFootsteps(*(np.array([value]) for value in whole))
    if measure == "speed":
        return steps.step_length / steps.period
    if measure in CycleFootsteps._fields:
        values: np.ndarray = getattr(steps, measure)
        return values if measure == "peak_normal" else values * len(values) / curve.footsteps
    return steps.recurring[:, recurring_names(curve.state_type).index(measure)]


def _doubling_of(child: Branch, given: list[Branch]) -> list[tuple[Branch, BranchPoint]]:
    """The period doubling from which a branch comes, on its own branch, where that is drawn."""
    stop = child.stops[0]
    if stop.end is not BranchEnd.BRANCHES_OFF:
        return []
    pairs = [(parent, event) for parent in given for event in parent.bifurcations]
    here = BranchEvent.PERIOD_DOUBLING, stop.value
    return [(parent, e.point) for parent, e in pairs if (e.kind, e.value) == here][:1]


def _look(k: int) -> dict[str, Any]:
    """Of the lines of the k-th number of footsteps: thinner ones for more of them."""
    return {"color": style.colour_of(k), "linewidth": max(0.8, 1.6 * 0.75**k)}


def _draw_errors(ax: Axes, curve: Branch, colour: str) -> None:
    """A band of the leading multiplier's errors, where they are known."""
    sizes = np.abs(curve.multipliers[:, 0])
    errors = np.array([point.multiplier_errors[0] for point in curve.points])
    look: dict[str, Any] = {"color": colour, "alpha": 0.25, "linewidth": 0.0, "zorder": 0.8}
    ax.fill_between(curve.values, sizes - errors, sizes + errors, **look)


def _draw_lines(
    ax: Axes, curve: Branch, given: list[Branch], measure: str, look: dict[str, Any]
) -> None:
    """Lines between neighbours; a bifurcation belongs to the gaits on either side of it."""
    pairs = _doubling_of(curve, given) + [(curve, point) for point in curve.points]
    special = {event.value for one, _ in pairs for event in one.bifurcations}
    x, rows = [point.value for _, point in pairs], [_values(measure, *pair) for pair in pairs]
    # Footsteps of a doubled cycle follow those of the cycle twice over.
    rows[0] = np.resize(rows[0], len(rows[-1]))
    kinds = [(b if a.value in special else a).stable for (_, a), (_, b) in pairwise(pairs)]
    if not kinds:
        ax.plot(x * len(rows[0]), rows[0], "o", color=look["color"], markersize=4)
    for kind, group in groupby(range(len(kinds)), key=kinds.__getitem__):
        first, *others = group
        part = slice(first, first + len(others) + 2)
        for y in np.transpose(rows[part]):
            ax.plot(x[part], y, linestyle=_STYLES[kind], **look)


def _entries(given: list[Branch], counts: list[int]) -> Iterator[Line2D]:
    """Of the legend: kinds of stability, footsteps of cycles where they differ, bifurcations."""
    grey, points = style.GROUND_COLOUR, [point for curve in given for point in curve.points]
    events = [event for curve in given for event in curve.bifurcations]
    # That gaits are undecided at bifurcations alone goes without saying.
    special = {event.value for event in events}
    stable = {p.stable for p in points if p.stable is not None or p.value not in special}
    for kind in (kind for kind in _WORDS if kind in stable):
        yield Line2D([], [], color=grey, linestyle=_STYLES[kind], label=_WORDS[kind])
    for k, count in enumerate(counts) if len(counts) > 1 else ():
        words = f"{count} footstep{'s' * (count > 1)}"
        yield Line2D([], [], label=words, **_look(k))
    drawn = {event.kind for event in events}
    for event, (marker, words) in EVENT_MARKS.items():
        if event in drawn:
            yield Line2D([], [], color=grey, marker=marker, linestyle="none", label=words)


def basin_fractions(
    values: npt.ArrayLike,
    fractions: Sequence[Mapping[str, Fraction]],
    *,
    name: str | Quantity,
    unit: str = "",
    kind: str = "lines",
    confidence: float = 0.95,
    log: bool = False,
    ax: Axes | None = None,
) -> Figure:
    """Draws the fraction of starts with each label against a parameter.

    The bands around the lines are Wilson's intervals of the counts (see `wilson_interval`). A label
    that did not occur at a value has the fraction 0 there.

    Args:
        values: values of the parameter, increasing, shape (n,).
        fractions: result of `jaxbiped.basins.fractions` at each value.
        name, unit: name and unit of the parameter. A parameter's own name, such as "K", needs no
            unit; nor does a `jaxbiped.laws.Quantity`.
        kind: "lines", or "stacked": areas that add up to one, without bands.
        confidence: confidence level of the bands.
        log: whether the parameter's axis is logarithmic.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: there is no value, the number of fractions differs, values do not increase or
            are not above 0 on a logarithmic axis, there is only one value to stack, or nothing is
            labelled at a value.
    """
    check_choice("kind", kind, ("lines", "stacked"))
    along = _check(values, fractions, log)
    if kind == "stacked" and along.size == 1:
        raise ArgumentError("values has one entry: a stacked figure must have at least 2.")
    labels = style.in_order({label for row in fractions for label in row})
    rows = [[row[name].count if name in row else 0 for row in fractions] for name in labels]
    counts = np.asarray(rows)
    totals = counts.sum(axis=0)
    parts, colours = counts / totals, [style.label_colour(label) for label in labels]
    ax = style.axes_or_new(ax, 7.2, 4.0)
    title, margin, order = "Fractions of the starts", 0.0, -1
    if kind == "stacked":
        ax.stackplot(along, parts, labels=labels, colors=colours, edgecolor="white", linewidth=0.4)
    else:
        title += f" (bands: {100.0 * confidence:.4g} % confidence)"
        margin, order = 0.02, 1
        bands = zip(*wilson_interval(counts, totals, confidence=confidence), strict=True)
        for label, colour, part, band in zip(labels, colours, parts, bands, strict=True):
            ax.fill_between(along, *band, color=colour, alpha=0.25, linewidth=0.0)
            look: dict[str, Any] = {"marker": style.label_marker(label), "markersize": 4.0}
            ax.plot(along, part, color=colour, label=label, clip_on=False, **look)
    style.dress(ax, title, axis_label(name, unit), "fraction of the starts")
    if log:
        ax.set_xscale("log")
    if along.size > 1:
        ax.set_xlim(along[0], along[-1])
    ax.set_ylim(-margin, 1.0 + margin)
    style.legend_right(ax, handles=ax.get_legend_handles_labels()[0][::order])
    return style.figure_of(ax)


def _check(
    values: npt.ArrayLike, fractions: Sequence[Mapping[str, Fraction]], log: bool
) -> np.ndarray:
    check_finite("values", values)
    along = np.asarray(values, dtype=float)
    if along.ndim != 1 or along.size == 0 or along.size != len(fractions):
        raise ArgumentError(
            f"values has shape {along.shape} and there are {len(fractions)} fractions: there must "
            "be one for each value, and at least one."
        )
    if (np.diff(along) <= 0.0).any():
        raise ArgumentError("values does not increase everywhere: it must.")
    if log:
        check_positive("values", along)
    empty = [k for k, row in enumerate(fractions) if not row]
    if empty:
        raise ArgumentError(
            f"fractions[{empty[0]}] is empty: at least one start must be labelled at each value."
        )
    return along

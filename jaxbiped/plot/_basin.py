"""Basin pictures in two coordinates of the start: on a grid, and refined; with marks of gaits."""

import functools
import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from jaxbiped._checks import ArgumentError, check_finite, check_type
from jaxbiped._quantity import Quantity
from jaxbiped.basins._label_statistics import fractions as fractions_of
from jaxbiped.basins._labels import Label, check_known, endings_of, label_names, word_of_code
from jaxbiped.basins._refined_boundary import RefinedBoundary
from jaxbiped.plot import style
from jaxbiped.plot._symbols import axis_label
from jaxbiped.plot.style import GAIT_SUFFIX

if TYPE_CHECKING:
    import xarray

_PENDING = "////"
"""Hatch over pending starts, which shows them as missing in print without colour."""
_PATTERNS = ("#102A40", "#A0A0A0")
"""Colours of patterns over walking and pending."""
_ASIDE = 2.2
"""Width that the legend beside the axes takes [inches]."""
_CORNERS = np.asarray([(0, 0), (1, 0), (1, 1), (0, 1)])
_LOOKS: tuple[dict[str, Any], ...] = (
    {"marker": "*", "markersize": 13},
    {"marker": "P", "markersize": 8},
    {"marker": "X", "markersize": 8},
    {"marker": "D", "markersize": 6},
)
_EDGE: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": "black"}


class GaitMark(NamedTuple):
    """A gait in the plane of a picture, once or along a parameter.

    Attributes:
        label: what the legend calls it.
        points: where it is, in the units of the axes, shape (n, 2).
    """

    label: str
    points: np.ndarray

    @classmethod
    def at(cls, mark: Any) -> "GaitMark":
        """The gait at one point that a user gives."""
        check_finite("mark", mark)
        if np.shape(mark) != (2,):
            raise ArgumentError(f"mark = {mark!r} is not allowed: it must be two numbers, x and y.")
        return cls("gait", np.asarray([mark], float))


def basin(
    labels: "npt.ArrayLike | xarray.DataArray | xarray.Dataset",
    x: npt.ArrayLike | None = None,
    y: npt.ArrayLike | None = None,
    *,
    names: tuple[str | Quantity, str | Quantity] | None = None,
    units: tuple[str, str] = ("", ""),
    cycle_footsteps: npt.ArrayLike | None = None,
    gait: npt.ArrayLike | None = None,
    mark: tuple[float, float] | None = None,
    title: str = "",
    ax: Axes | None = None,
) -> Figure:
    """Draws labels of starts on a grid, each in its own colour, with the fraction of each label.

    Args:
        labels: codes of `Label` or names (`label_names`), shape (ny, nx); row by row along y. Or a
            labelled array, which is drawn along the axes named by `names` or `x` and `y` (default:
            its first axis along x). Or the dataset of a `sweep`, which needs no further arguments.
        x, y: coordinates along the two axes, increasing: centres, shape (nx,) and (ny,), or edges
            of the cells, one more. Default: the coordinates of a labelled array.
        names, units: words and units of the axes, such as ("angle of the stance leg", …) and
            ("rad", …). The name of a coordinate or parameter, such as "theta_swing", needs no unit;
            nor does a `jaxbiped.laws.Quantity` (see `jaxbiped.starts.coordinate_quantities`).
        cycle_footsteps: number of footsteps in the cycle of the gait that each start walks to, a
            shape that broadcasts to (ny, nx); only for codes. Default: not shown.
        gait: number of that gait, from 0, which distinguishes gaits with equally long cycles; only
            for codes.
        mark: position of the gait, in the units of the axes. Default: the gaits in the dataset of a
            `sweep`, as curves if an axis is a parameter, and projected if they are off the slice.
        title: title above the axes.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: shapes do not fit, the grid is empty, or coordinates do not increase.
    """
    data: Any = labels if hasattr(labels, "data_vars") else None
    marks = [] if mark is None else [GaitMark.at(mark)]
    if data is not None:
        labels, cycle_footsteps, gait = data.label, data.cycle_footsteps, gaits_apart(data)
    if hasattr(labels, "dims"):
        known: Any = labels
        along = _axes_of(known, x, y, names)
        if names is None:
            names = _quantity_of(known[along[0]]), _quantity_of(known[along[1]])
        if data is not None and mark is None:
            marks = gait_marks(data, *along)
        x, y = (known[n] if c is None else c for n, c in zip(along, (x, y), strict=True))
        parts: tuple[Any, ...] = (known, cycle_footsteps, gait)
        labels, cycle_footsteps, gait = (
            each.transpose(*along[::-1]) if hasattr(each, "dims") else each for each in parts
        )
    if x is None or y is None or names is None:
        raise ArgumentError("x, y and names are needed, because these labels carry no axes.")
    words = _names_of(labels, cycle_footsteps, gait)
    x_edges, y_edges = _edges("x", x, words.shape[1]), _edges("y", y, words.shape[0])
    ax = style.axes_or_new(ax, 7.2, 4.4, aside=_ASIDE)
    _draw_labels(ax, words, x_edges, y_edges)
    return _finish(ax, words, names, units, marks, title)


def refined_basin(
    boundary: RefinedBoundary,
    *,
    names: tuple[str | Quantity, str | Quantity],
    units: tuple[str, str] = ("", ""),
    codes: Mapping[int, str] | None = None,
    cells: bool = True,
    mark: tuple[float, float] | None = None,
    title: str = "",
    ax: Axes | None = None,
) -> Figure:
    """Draws the labels about a refined boundary, and outlines the cells that were halved.

    Fractions are those of the full grid of the finest level, with labels filled in as by
    `RefinedBoundary.on_grid`.

    Args:
        boundary: a boundary in two dimensions; x is the first.
        names, units: words and units of the axes (see `basin`).
        codes: names of the label codes. Default: those of `Label`.
        cells: whether to outline the boundary cells of all levels except the finest; these cells
            were halved.
        mark: position of the gait, in the units of the axes.
        title: title above the axes. Default: the number of labels that were computed.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: this is not a refined boundary of two dimensions, or a code has no name.
    """
    check_type("boundary", boundary, RefinedBoundary)
    if len(boundary.shape) != 2:
        raise ArgumentError(f"boundary has {len(boundary.shape)} dimensions: it must have 2.")
    words = boundary.on_grid().T
    if codes is None:
        words = _names_of(words)
    elif nameless := sorted(set(boundary.labels.tolist()) - set(codes)):
        raise ArgumentError(f"codes has no name for label {nameless[0]}: each must have one.")
    else:
        words = np.vectorize(codes.__getitem__, otypes=[object])(words)
    ax = style.axes_or_new(ax, 7.2, 4.4, aside=_ASIDE)
    half = 0.5 * boundary.cell_size(boundary.levels)
    axes = (np.append(boundary.axis(k) - half[k], boundary.axis(k)[-1] + half[k]) for k in (0, 1))
    _draw_labels(ax, words, *axes)
    handles = []
    for level in range(boundary.levels) if cells else ():
        size = boundary.cell_size(level)
        corners = boundary.lower + (boundary.cells[level][:, None] + _CORNERS) * size
        # Finer levels in thinner lines.
        look: dict[str, Any] = {"edgecolors": "black", "linewidths": 0.7 * 0.7**level}
        ax.add_collection(PolyCollection(list(corners), facecolors="none", **look), autolim=False)
        handles = [Line2D([], [], color="black", linewidth=0.6, label="halved cells")]
    ax.set_xlim(boundary.lower[0], boundary.upper[0])
    ax.set_ylim(boundary.lower[1], boundary.upper[1])
    title = title or f"{boundary.asked} labels of the full grid's {boundary.full}"
    marks = [] if mark is None else [GaitMark.at(mark)]
    return _finish(ax, words, names, units, marks, title, handles)


def _axes_of(labels: Any, x: Any, y: Any, names: Any) -> tuple[str, str]:
    """The dimensions of labelled labels along x and y; `ArgumentError` unless they are two."""
    if len(labels.dims) != 2:
        raise ArgumentError(
            f"labels has the axes {', '.join(map(str, labels.dims))}: choose two of them, and one "
            "place of each other."
        )
    first, second = labels.dims
    told = (getattr(x, "name", None), None if names is None else names[0])
    as_given = x is not None and first not in told
    return (second, first) if second in told or as_given else (first, second)


def _quantity_of(coordinate: Any) -> str | Quantity:
    """What a dataset's coordinate is: by its name, or by name and unit where that says nothing."""
    name, unit = str(coordinate.name), coordinate.attrs.get("units", "")
    return name if axis_label(name) != name else Quantity(name, unit=unit)


def _names_of(
    labels: Any, cycle_footsteps: npt.ArrayLike | None = None, gait: npt.ArrayLike | None = None
) -> np.ndarray:
    """Names on a grid of two dimensions, from names or codes, footsteps in a cycle and gaits."""
    grid = np.asarray(labels)
    if grid.ndim != 2 or grid.size == 0:
        raise ArgumentError(
            f"labels has shape {grid.shape}: it must be (ny, nx) with at least one entry."
        )
    if grid.dtype.kind not in "iu":
        return grid.astype(str).astype(object)
    endings = endings_of(labels)
    check_known(grid, endings)
    if cycle_footsteps is None:
        word = functools.partial(word_of_code, endings=endings)
        words = np.vectorize(word, otypes=[object])(grid)
    else:
        cycles = _fitting_names("cycle_footsteps", cycle_footsteps, grid.shape)
        words = label_names(grid, cycles, endings=endings)
    if gait is not None:
        which = _fitting_names("gait", gait, grid.shape)
        walks = grid == Label.WALKING
        words[walks] += [style.GAIT_SUFFIX.format(gait=k) for k in which[walks]]
    return words


def _fitting_names(name: str, value: npt.ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
    array = np.asarray(value)
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ArgumentError(
            f"{name} has shape {array.shape}: it must fit labels, {shape}."
        ) from None


def _edges(name: str, value: npt.ArrayLike, n: int) -> np.ndarray:
    """The edges of n cells, given them or the centres."""
    check_finite(name, value)
    array = np.asarray(value, dtype=float)
    if array.shape not in ((n,), (n + 1,)):
        raise ArgumentError(
            f"{name} has shape {array.shape}: it must be ({n},), centres, or ({n + 1},), edges."
        )
    if (np.diff(array) <= 0.0).any():
        raise ArgumentError(f"{name} does not increase everywhere: it must.")
    if array.size == n + 1:
        return array
    if n == 1:
        raise ArgumentError(f"{name} has one centre: it must be given by its 2 edges.")
    middle = 0.5 * (array[1:] + array[:-1])
    return np.concatenate([[2 * array[0] - middle[0]], middle, [2 * array[-1] - middle[-1]]])


def _draw_labels(ax: Axes, words: np.ndarray, x_edges: np.ndarray, y_edges: np.ndarray) -> None:
    """Fills each cell with its label's colour, and hatches what is pending."""
    present = sorted(set(words.ravel().tolist()))
    codes = np.searchsorted(present, words.astype(str))
    colours = ListedColormap([style.label_colour(name) for name in present])
    norm = BoundaryNorm(np.arange(len(present) + 1) - 0.5, len(present))
    ax.pcolormesh(x_edges, y_edges, codes, cmap=colours, norm=norm, rasterized=True)
    for name in present:
        if hatch := _hatch(name):
            _draw_hatch(ax, words == name, x_edges, y_edges, hatch)


def _hatch(name: str) -> str:
    """The pattern over a label's cells, where there is one."""
    return _PENDING if name == str(Label.PENDING) else style.walking_pattern(name)


def _draw_hatch(
    ax: Axes, cells: np.ndarray, x_edges: np.ndarray, y_edges: np.ndarray, hatch: str
) -> None:
    """A pattern over some cells; each run of them in a row is one rectangle."""
    turns = np.diff(np.pad(cells.astype(int), ((0, 0), (1, 1))), axis=1)
    (row, left), (_, right) = np.nonzero(turns == 1), np.nonzero(turns == -1)
    across = x_edges[np.stack([left, right, right, left], axis=1)]
    along = y_edges[np.stack([row, row, row + 1, row + 1], axis=1)]
    runs = list(np.stack([across, along], axis=-1))
    look: dict[str, Any] = {"edgecolors": _PATTERNS[hatch == _PENDING], "linewidths": 0.0}
    look["hatch"] = hatch
    ax.add_collection(PolyCollection(runs, facecolors="none", **look), autolim=False)


def _finish(
    ax: Axes,
    words: np.ndarray,
    names: tuple[str | Quantity, str | Quantity],
    units: tuple[str, str],
    marks: list[GaitMark],
    title: str,
    more: Sequence[Line2D] = (),
) -> Figure:
    """Names of the axes, the gaits' marks, and the legend with fractions right of the axes."""
    handles = [*_patches(words), *more, *draw_gait_marks(ax, marks)]
    style.legend_right(ax, handles=handles)
    ax.set_xlabel(axis_label(names[0], units[0]))
    ax.set_ylabel(axis_label(names[1], units[1]))
    style.set_title(ax, title)
    return style.figure_of(ax)


def _patches(words: np.ndarray) -> Iterator[Patch]:
    """Entries of the legend: labels that occur, with their parts of what is labelled."""
    fractions, pending = fractions_of(words), str(Label.PENDING)
    for name in style.in_order(set(words.ravel().tolist())):
        part = f"{int((words == name).sum())} of {words.size}"
        look: dict[str, Any] = {"edgecolor": "#404040", "linewidth": 0.5}
        if name != pending:
            part = _percent(fractions[name].estimate)
        if hatch := _hatch(name):
            look = {"edgecolor": _PATTERNS[hatch == _PENDING], "hatch": hatch}
        yield Patch(facecolor=style.label_colour(name), label=f"{name}: {part}", **look)


def _percent(part: float) -> str:
    """A part as a percentage; never as 0 % of what occurs or 100 % of what is not all."""
    digits = 2 if 0.0 < part < 0.001 or 0.999 < part < 1.0 else 1
    shown = f"{100.0 * part:.{digits}f}"
    if part < 1.0 and float(shown) == 100.0:
        return "> 99.99 %"
    return "< 0.01 %" if part > 0.0 and float(shown) == 0.0 else f"{shown} %"


def gait_marks(dataset: Any, x: str, y: str) -> list[GaitMark]:
    """The gaits of a sweep's dataset in the plane of two of its coordinates.

    A gait that lies off the plane, as its other coordinates are not those of the starts, is
    projected onto it, and its label says so.
    """
    settings = json.loads(dataset.attrs.get("settings", "{}"))
    places = {str(n): c for n, c in dataset.coords.items() if not c.ndim}
    fixed = {name: float(c) for name, c in places.items() if c.dtype.kind in "iuf"}
    based = "base" in settings.get("starts", {})
    found: dict[int, list[tuple[float, float, bool]]] = {}
    for row in json.loads(dataset.attrs.get("gaits", "[]")):
        parameters = row["parameters"]
        if any(n in fixed and not np.isclose(fixed[n], v) for n, v in parameters.items()):
            continue
        for k, gait in enumerate(row["gaits"]):
            place = gait.get("coordinates", {}) | parameters
            if x not in place or y not in place:
                continue
            off = k > 0 or based or any(
                n in place and not np.isclose(v, place[n]) for n, v in fixed.items()
            )  # fmt: skip
            found.setdefault(k, []).append((place[x], place[y], off))
    marks = []
    for k, rows in found.items():
        points = np.array(sorted((a, b) for a, b, _ in rows))
        label = "gait" if len(found) == 1 else GAIT_SUFFIX.format(gait=k).removeprefix(", ")
        projected = ", projected" * any(off for *_, off in rows)
        marks.append(GaitMark(label + projected, points))
    return marks


def gaits_apart(data: Any) -> Any:
    """Which gait starts walk to, where there are several of one cycle's length; None elsewhere."""
    walks = data.label.values == Label.WALKING
    kinds = {*zip(data.cycle_footsteps.values[walks], data.gait.values[walks], strict=True)}
    return data.gait if len({cycle for cycle, _ in kinds}) < len(kinds) else None


def draw_gait_marks(ax: Axes, marks: list[GaitMark]) -> list[Line2D]:
    """Draws them, those within the axes' limits; returns their entries of the legend."""
    entries = []
    limits = np.array([sorted(ax.get_xlim()), sorted(ax.get_ylim())])
    for k, mark in enumerate(marks):
        inside = (mark.points >= limits[:, 0]) & (mark.points <= limits[:, 1])
        shown = mark.points[inside.all(axis=1)]
        if not len(shown):
            continue
        look = _LOOKS[k % len(_LOOKS)] | _EDGE
        if len(shown) > 1:
            look |= {"markersize": 0.6 * look["markersize"], "color": "black", "linewidth": 0.9}
        else:
            look |= {"linestyle": "none"}
        ax.plot(*shown.T, clip_on=False, zorder=5, **look)
        entries.append(Line2D([], [], label=mark.label, **look))
    return entries

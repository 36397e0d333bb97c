"""What a figure shows as plain numbers and words, which may be written to a file and compared.

Places are in parts of the axes, 0 at the left and the bottom, so that one tolerance holds for all.
What matplotlib chooses by itself (places of ticks, layout, its own defaults) is left out.
"""

from typing import Any

import numpy as np
from matplotlib import colors
from matplotlib.axes import Axes
from matplotlib.collections import (
    Collection,
    EllipseCollection,
    LineCollection,
    PathCollection,
    QuadMesh,
)
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedLocator, MaxNLocator, NullFormatter

USUAL: dict[str, tuple[Any, ...]] = {
    **dict.fromkeys(("alpha", "anchor", "hatch", "length", "order"), (None,)),
    **dict.fromkeys(("collections", "legends", "lines", "patches", "texts", "written"), ([],)),
    **dict.fromkeys(("edge", "face", "title"), (None, "")),
    **dict.fromkeys(("label", "words"), ("",)),
    **dict.fromkeys(("ticks", "x", "y"), ({},)),
    **dict.fromkeys(("integer", "named"), (False,)),
    **dict.fromkeys(("aspect", "most"), ("auto",)),
    **dict.fromkeys(("clip", "on"), (True,)),
    "adjustable": ("box",),
    "anchored": ("left baseline",),
    "below": ("True",),
    "bottom": (None, True),
    "colour": (None, "#000000"),
    "columns": (1,),
    "dashes": (None, "solid", [None]),
    "dpi": (120,),
    "font": (10.0,),
    "frame": (False, 0.8),
    "grid": ([True, True, "#e6e6e6", 0.6], [False, False, "", None]),
    "hidden": ("right top",),
    "kind": ("Rectangle",),
    "legend": (None,),
    "letters": (8.33,),
    "marker": ("None",),
    "pad": (0.5,),
    "place": (None, [1, 1, 0, [1.0], [1.0]]),
    "sample": (2.0,),
    "scale": (["linear"],),
    "size": (0.0,),
    "width": (0.0, [1.0]),
}
"""What is not written where it is so."""
FEW = 6
"""Curves of no more points are written whole."""


def figure_numbers(figure: Figure, *, counted: bool = True, data: bool = True) -> dict[str, Any]:
    """A figure with all its axes.

    Without `counted` how many points a curve has is left out, without `data` all but the words.
    """
    return _with_whole_numbers(
        _without_usual(
            size=_rounded([figure.get_figwidth(), figure.get_figheight()]),
            dpi=figure.dpi,
            legends=[_legend(each, []) for each in figure.legends],
            axes=[_axes(ax, counted, data) for ax in figure.axes],
        )
    )


def _with_whole_numbers(described: Any) -> Any:
    """Without the points of numbers that need none: a shorter file."""
    if isinstance(described, dict):
        return {name: _with_whole_numbers(each) for name, each in described.items()}
    if isinstance(described, list):
        return [_with_whole_numbers(each) for each in described]
    whole = isinstance(described, float) and described.is_integer()
    return int(described) if whole else described


def _rounded(values: Any, digits: int = 4) -> Any:
    """Numbers to so many digits, in lists as deep as an array is."""
    array = np.asarray(values, float)
    if array.ndim:
        return [_rounded(each, digits) for each in array]
    return float(f"{float(array):.{digits}g}") if np.isfinite(array) else str(float(array))


def _shares(ax: Axes, points: Any, transform: Any) -> np.ndarray:
    """Points (n, 2) in parts of the axes."""
    pixels = transform.transform(np.asarray(points, float).reshape(-1, 2))
    return ax.transAxes.inverted().transform(pixels)


def _curve(ax: Axes, points: Any, transform: Any, counted: bool) -> Any:
    """A curve: its points if they are few, else its ends, its box and the middle of its length."""
    places = _shares(ax, points, transform)
    if len(places) <= FEW:
        return np.round(places, 3).tolist()
    known = places[np.isfinite(places).all(axis=1)]
    if not len(known):
        return "nothing"
    lengths = np.hypot(*np.diff(known, axis=0).T)
    middle = (0.5 * (known[1:] + known[:-1]) * lengths[:, None]).sum(axis=0)
    told = [known[0], known[-1], known.min(axis=0), known.max(axis=0), middle / lengths.sum()]
    count = {"points": len(places), "gaps": int(len(places) - len(known))} if counted else {}
    return count | {"curve": np.round(told, 3).tolist()}


def _colour(colour: Any) -> str:
    array = colors.to_rgba_array(colour)
    if len(array) > 30:
        return f"{len(array)} colours"
    words = [colors.to_hex(each, keep_alpha=True).removesuffix("ff") for each in array]
    return " ".join(dict.fromkeys(word if len(word) > 6 else f"{word}ff" for word in words))


def _without_usual(**told: Any) -> dict[str, Any]:
    return {name: x for name, x in told.items() if x not in USUAL.get(name, ())}


def _name(artist: Any) -> str:
    """Its label, unless matplotlib made it up."""
    label = str(artist.get_label() or "")
    return "" if label.startswith("_") else label


def _order(artist: Any, usual: int) -> dict[str, Any]:
    return {} if artist.get_zorder() == usual else {"order": artist.get_zorder()}


def _line_look(line: Line2D) -> dict[str, Any]:
    marked = line.get_marker() not in ("None", None, "")
    offset, dashes = line._unscaled_dash_pattern  # which no public name tells
    drawn = line.get_linestyle() not in ("None", "", " ")
    colour = _colour(line.get_color())
    face, edge = _colour(line.get_markerfacecolor()), _colour(line.get_markeredgecolor())
    return _without_usual(
        label=_name(line),
        colour=colour,
        alpha=line.get_alpha(),
        dashes=None if dashes is None else _rounded([*dashes, *[offset] * bool(offset)]),
        width=_rounded(line.get_linewidth()) if drawn else 0.0,
        marker=str(line.get_marker()),
        size=_rounded(line.get_markersize()) if marked else 0.0,
        face=face if marked and face != colour else None,
        edge=edge if marked and edge != face else None,
    )


def _line(ax: Axes, line: Line2D, counted: bool) -> dict[str, Any]:
    look = _line_look(line) | _without_usual(clip=line.get_clip_on()) | _order(line, 2)
    if hasattr(line, "get_slope"):
        return look | {"slope": _rounded(line.get_slope()), "through": _rounded(line.get_xy1())}
    if line.get_marker() in ("|", "_"):  # a cap of an error bar, which is where its bar ends
        return look
    return look | {"at": _curve(ax, line.get_xydata(), line.get_transform(), counted)}


def _patch(ax: Axes | None, patch: Patch) -> dict[str, Any]:
    told = _without_usual(
        kind=type(patch).__name__,
        label=_name(patch),
        face=_colour(patch.get_facecolor()),
        edge=_colour(patch.get_edgecolor()),
        width=_rounded(patch.get_linewidth()),
        dashes=str(patch.get_linestyle()),
        hatch=patch.get_hatch(),
        alpha=patch.get_alpha(),
    )
    if ax is None:
        return told
    box = patch.get_transform().transform_path(patch.get_path()).get_extents()
    places = ax.transAxes.inverted().transform(box.get_points())
    return told | {"box": np.round(places, 3).tolist()} | _order(patch, 1)


def _collection(ax: Axes, drawn: Collection, counted: bool) -> dict[str, Any]:
    drawn.update_scalarmappable()
    told = _without_usual(
        kind=type(drawn).__name__,
        label=_name(drawn),
        face=_colour(drawn.get_facecolor()),
        edge=_colour(drawn.get_edgecolor()),
        alpha=None if drawn.get_alpha() is None else _rounded(drawn.get_alpha()),
        width=_rounded(np.unique(drawn.get_linewidth())),
        dashes=[None if each is None else _rounded(each) for _, each in drawn.get_linestyle()],
        hatch=drawn.get_hatch(),
    ) | _order(drawn, 2 if isinstance(drawn, LineCollection) else 1)
    if (values := drawn.get_array()) is not None:
        told |= {"values": _rounded(np.ravel(values)) if np.size(values) < 30 else "many"}
        told |= {"map": drawn.get_cmap().name, "norm": type(drawn.norm).__name__}
    if isinstance(drawn, EllipseCollection):
        told |= {"widths": _rounded(2.0 * np.unique(np.round(drawn._widths, 6)))}
    if isinstance(drawn, EllipseCollection | PathCollection):
        places = _shares(ax, drawn.get_offsets(), drawn.get_offset_transform())
        told |= (
            {"sizes": _rounded(np.unique(drawn.get_sizes()))} if hasattr(drawn, "get_sizes") else {}
        )
        return told | {"at": np.round(places[:FEW], 3).tolist()}
    if isinstance(drawn, QuadMesh):
        return told | {"at": _curve(ax, drawn.get_coordinates(), drawn.get_transform(), counted)}
    paths = drawn.get_paths()
    if isinstance(drawn, LineCollection) or counted:
        told |= {"paths": len(paths)}
    if not sum(len(path.vertices) for path in paths):
        return told | {"at": "nothing"}
    vertices = np.concatenate([path.vertices for path in paths])
    return told | {"at": _curve(ax, vertices, drawn.get_transform(), counted)}


def _text(ax: Axes, text: Text) -> dict[str, Any]:
    look = _without_usual(
        text=text.get_text(),
        letters=_rounded(text.get_fontsize()),
        colour=_colour(text.get_color()),
        anchored=f"{text.get_ha()} {text.get_va()}",
    )
    if isinstance(text, Annotation):
        look["at"] = np.round(_shares(ax, text.xy, ax.transData), 3).tolist()
        if text.anncoords == "offset points":
            return look | {"shift": _rounded(text.xyann)}
        arrow = text.arrow_patch
        assert arrow is not None
        kind = type(arrow.get_arrowstyle()).__name__
        look = {"arrow": kind, "colour": _colour(arrow.get_facecolor()), "at": look["at"]}
        look["sizes"] = [arrow.get_mutation_scale(), arrow.get_linewidth()]
        look["sizes"] += [arrow.shrinkA, arrow.shrinkB]
        return look | {"from": np.round(_shares(ax, text.xyann, ax.transData), 3).tolist()}
    places = _shares(ax, text.get_position(), text.get_transform())
    return look | {"at": np.round(places, 3).tolist()}


def _legend(legend: Legend, drawn: list[dict[str, Any]]) -> dict[str, Any]:
    """A legend; the samples of entries that look as what is drawn is known by their words."""
    entries: list[Any] = []
    for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True):
        look = _handle(handle) | {"label": text.get_text()}
        same = any(look.items() <= each.items() for each in drawn)
        entries.append(text.get_text() if same else look)
    letters = [text.get_fontsize() for text in legend.get_texts()[:1]]
    title = legend.get_title()
    anchor = legend._bbox_to_anchor  # of which the public method gives pixels
    return _without_usual(
        place=str(legend._loc),
        anchor=None if anchor is None else _rounded(getattr(anchor, "_bbox", anchor).p0),
        columns=legend._ncols,
        letters=_rounded(letters[0]),
        title=[title.get_text(), _rounded(title.get_fontsize())] if title.get_text() else None,
        frame=legend.get_frame_on(),
        sample=_rounded(legend.handlelength),
        pad=_rounded(legend.borderaxespad),
        entries=entries,
    )


def _handle(handle: Any) -> dict[str, Any]:
    if isinstance(handle, Line2D):
        look = _line_look(handle)
    elif isinstance(handle, Patch):
        look = _patch(None, handle)
    else:  # of error bars and of lines of a collection
        look = {"kind": type(handle).__name__}
    look.pop("label", None)
    return look


def _axis(axis: Any) -> dict[str, Any]:
    """Its words, its scale, and the ticks that are set or what is asked of others."""
    look: dict[str, Any] = {}
    if isinstance(axis.get_major_locator(), FixedLocator):
        labels = axis.get_ticklabels()
        look["ticks"] = _rounded(axis.get_ticklocs())
        look["written"] = [each.get_text() for each in labels]
        look["letters"] = _rounded([each.get_fontsize() for each in labels[:1]])
    elif isinstance(axis.get_major_locator(), MaxNLocator):
        look["integer"] = bool(axis.get_major_locator()._integer)
        look["most"] = str(axis.get_major_locator()._nbins)
    known = axis.get_tick_params(which="major")
    return _without_usual(
        words=axis.label.get_text(),
        font=_rounded(axis.label.get_fontsize()),
        scale=_scale(axis),
        limits=_rounded(axis.get_view_interval()),
        named=not isinstance(axis.get_minor_formatter(), NullFormatter),
        bottom=known.get("labelbottom"),
        length=known.get("length"),
        **look,
    )


def _scale(axis: Any) -> list[Any]:
    transform, known = axis.get_transform(), []
    for name in ("linthresh", "linscale", "linear_width"):
        if hasattr(transform, name):
            known += [name, _rounded(getattr(transform, name))]
    return [axis.get_scale(), *known]


def _axes(ax: Axes, counted: bool, data: bool) -> dict[str, Any]:
    if not ax.axison and not ax.texts and not ax.lines:
        return {"axes": "off"}
    spec, place = ax.get_subplotspec(), None
    if spec is not None:
        whole = spec.get_gridspec()
        place = [whole.nrows, whole.ncols, spec.num1, _rounded(whole.get_width_ratios())]
        place += [_rounded(whole.get_height_ratios())]
    known = ax.xaxis.get_tick_params(which="major"), ax.yaxis.get_tick_params(which="major")
    ax.get_xlim(), ax.get_ylim()  # which sets the limits that are still to be found
    lines = [_line(ax, each, counted) for each in ax.lines]
    patches = [_patch(ax, each) for each in ax.patches]
    drawn = [_collection(ax, each, counted) for each in ax.collections]
    artists: dict[str, Any] = {"lines": lines, "patches": patches, "collections": drawn}
    artists["texts"] = [_text(ax, each) for each in ax.texts]
    hidden = [side for side, spine in ax.spines.items() if not spine.get_visible()]
    return _without_usual(
        on=bool(ax.axison),
        place=place,
        title=ax.get_title(loc="left"),
        font=_rounded(ax._left_title.get_fontsize()) if ax.get_title(loc="left") else 10.0,
        x=_axis(ax.xaxis),
        y=_axis(ax.yaxis),
        aspect=ax.get_aspect() if ax.get_aspect() == "auto" else float(ax.get_aspect()),
        adjustable=ax.get_adjustable(),
        grid=[bool(each.get("gridOn", False)) for each in known]
        + [str(known[0].get("grid_color", "")).lower(), known[0].get("grid_linewidth")],
        frame=_rounded(ax.spines["left"].get_linewidth()),
        below=str(ax.get_axisbelow()),
        hidden=" ".join(sorted(hidden)),
        legend=None if ax.get_legend() is None else _legend(ax.get_legend(), lines + patches),
        **artists if data else {},
    )

"""Style that all figures share: colours, sizes, new figures, and where legends go."""

import re
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from jaxbiped.basins._labels import Label

LEG_COLOURS = ("#0072B2", "#D55E00")
"""Leg 1 blue, leg 2 vermilion: two of Okabe and Ito's colours, distinct to colour-blind readers."""
LEG_COLOURS_ON_DARK = ("#56B4E9", "#E69F00")
"""Sky blue and orange, of the same colours, which stand out from a dark page."""
LEG_STYLES: tuple[Any, ...] = ("-", (0, (5, 1.5)))
"""Leg 1 solid, leg 2 dashed, for print without colour."""
LEG_NAMES = ("leg 1", "leg 2")
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's, in the order in which lines of many kinds take them."""
GROUND_COLOUR = "#595959"
SHADE_COLOUR = "#DDDDDD"
_ENERGY_COLOURS = {
    "kinetic": ("#0072B2", "#56B4E9"),
    "elastic": ("#A8578A", "#CC79A7"),
    "supplied": ("#00795A", "#2CC79B"),
    "lost": ("#B84C00", "#E69F00"),
}
"""Of each energy's curve in the viewer, on a light page and on a dark one."""


def view_colours() -> dict[str, str]:
    """The viewer's colours, `light-…` and `dark-…`, by what they stand for."""
    pairs = {
        f"leg-{leg}": pair
        for leg, pair in enumerate(zip(LEG_COLOURS, LEG_COLOURS_ON_DARK, strict=True), 1)
    }
    pairs |= _ENERGY_COLOURS | {"ground": (GROUND_COLOUR, "#B9B9B9")}
    return {
        f"{page}-{name}": pair[k]
        for k, page in enumerate(("light", "dark"))
        for name, pair in pairs.items()
    }


def colour_of(k: int) -> str:
    """The colour of the k-th kind of line."""
    return COLOURS[k % len(COLOURS)]


def leg_line(k: int) -> dict[str, Any]:
    """Colour and style of a leg's line, legs counted from 0, for `Axes.plot`."""
    return {"color": LEG_COLOURS[k], "linestyle": LEG_STYLES[k]}


def new_figure(width: float = 6.4, height: float = 4.0) -> Figure:
    """A figure [inches] that knows how to draw itself, apart from pyplot's list of figures."""
    figure = Figure(figsize=(width, height), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def axes_or_new(ax: Axes | None, width: float = 6.4, height: float = 4.0) -> Axes:
    """The axes given, or those of a new figure."""
    return new_figure(width, height).add_subplot() if ax is None else ax


def figure_of(ax: Axes) -> Figure:
    """The figure that axes belong to, also where they lie in a subfigure."""
    figure = ax.figure.figure
    assert isinstance(figure, Figure)
    return figure


def dress(ax: Axes, title: str, x_label: str, y_label: str) -> None:
    """Title, labels and a faint grid."""
    ax.set_title(title, loc="left", fontsize="medium")
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    ax.grid(color="#E6E6E6", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def label_point(
    ax: Axes, text: str, place: tuple[float, float], shift: tuple[float, float], **anchor: Any
) -> None:
    """Writes a few words beside a point, so many points of print away from it."""
    ax.annotate(text, place, xytext=shift, textcoords="offset points", fontsize="small", **anchor)


def legend(ax: Axes, **options: Any) -> None:
    """A legend in small letters without a frame, within the axes unless told otherwise."""
    ax.legend(**{"frameon": False, "fontsize": "small"} | options)


def legend_below(ax: Axes, *, columns: int, **options: Any) -> None:
    """A legend under the axes, for more than fits beside the title."""
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14)}
    legend(ax, **place, ncols=columns, borderaxespad=0.2, **options)


def legend_above(ax: Axes, **options: Any) -> None:
    """A legend in one row above the axes, right of the title, where it covers no data."""
    entries = options.get("handles") or ax.get_legend_handles_labels()[0]
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
    legend(ax, **place | {"ncols": max(len(entries), 1), "borderaxespad": 0.2} | options)


def legend_right(ax: Axes, **options: Any) -> None:
    """A legend right of the axes, for entries of many words."""
    legend(ax, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, **options)


_LABEL_COLOURS = {
    str(Label.FELL_FORWARD): "#D55E00",
    str(Label.FELL_BACK): "#E69F00",
    str(Label.STOPPED): "#009E73",
    str(Label.STUMBLED): "#CC79A7",
    str(Label.SLID): "#F0E442",
    str(Label.OUT_OF_STEPS): "#8C8C8C",
    str(Label.SOLVER_FAILED): "#000000",
    str(Label.UNRESOLVED): "#4D4D4D",
    str(Label.TIMED_OUT): "#B4B4B4",
    str(Label.PENDING): "#E8E8E8",
}
"""Okabe and Ito's colours, told apart by colour-blind readers; greys where nothing is known."""
_BLUES = ("#0072B2", "#56B4E9", "#0B3C5D", "#A6D8F5", "#3A6EA5", "#1E90FF")
"""Walking: shades by gait, or else by the cycle's length; they repeat after six."""
_WALKING_MARKERS = "os8hpH"
_MARKERS = "D^vPX*<>d."
_ORDER = list(_LABEL_COLOURS)
GAIT_SUFFIX = ", gait {gait}"
"""Said after the name of what walks, where several gaits are told apart."""


def label_colour(name: str) -> str:
    """The colour of a label's name (`label_name`); grey for a name that is not known."""
    if not _walks(name):
        return _LABEL_COLOURS.get(name, "#BBBBBB")
    return _BLUES[_shade(name) % len(_BLUES)]


def in_order(names: set[str]) -> list[str]:
    """Names in one order for all legends: walking, then the endings, pending last."""
    return sorted(names, key=lambda name: (not _walks(name), _place(name), name))


def label_marker(name: str) -> str:
    """The marker of a label's name on a line, by which it is known without colour."""
    markers = _WALKING_MARKERS if _walks(name) else _MARKERS
    return markers[(_shade(name) if _walks(name) else _place(name)) % len(markers)]


def _place(name: str) -> int:
    return _ORDER.index(name) if name in _ORDER else len(_ORDER)


def _shade(name: str) -> int:
    """Of what walks, by its gait, or else by the length of its cycle."""
    numbers = [int(number) for number in re.findall(r"\d+", name)]
    return numbers[-1] if len(numbers) > 1 else (numbers or [1])[0] - 1


def _walks(name: str) -> bool:
    return name.startswith(str(Label.WALKING))

"""Style that all figures share: colours, markers, labels of axes, and where legends go."""

import math
import re
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from jaxbiped.basins._labels import PERIODIC, Label
from jaxbiped.plot._figure_style import has_titles as has_titles
from jaxbiped.plot._figure_style import is_narrow as is_narrow
from jaxbiped.plot._figure_style import letter_size as letter_size
from jaxbiped.plot._figure_style import make_room
from jaxbiped.plot._figure_style import new_figure as new_figure
from jaxbiped.plot._figure_style import panels_abreast as panels_abreast

_GROUPS = (
    ("#0072B2", "#56B4E9"),
    ("#D55E00", "#E69F00"),
    ("#00795A", "#2CC79B"),
    ("#A8578A", "#CC79A7"),
    ("#7A5C00", "#F0E442"),
    ("#4B3FA0", "#B5A9FF"),
)
"""Of each leg and of each body that is in none, on a light page and on a dark one; they repeat.

Leg 1 is blue, leg 2 vermilion: Okabe and Ito's colours, distinct to colour-blind readers.
"""
LEG_COLOURS = tuple(light for light, _ in _GROUPS)
LEG_STYLES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (6, 1.5, 1.5, 1.5)),
    (0, (1.5, 1.2)),
    (0, (9, 2)),
    (0, (3, 1, 1, 1, 1, 1)),
)
"""Leg 1 solid, leg 2 dashed, for print without colour."""
_FADES = 0.62
"""What is left of a colour's depth from a body to the next one of its leg."""
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's, in the order in which lines of many kinds take them."""
GROUND_COLOUR, SHADE_COLOUR = "#595959", "#DDDDDD"
_ENERGY_COLOURS = {
    "kinetic": ("#0072B2", "#56B4E9"),
    "elastic": ("#A8578A", "#CC79A7"),
    "supplied": ("#00795A", "#2CC79B"),
    "driven": ("#404040", "#D0D0D0"),
    "lost": ("#B84C00", "#E69F00"),
}
"""Of each energy's curve in the viewer, on a light page and on a dark one."""


def view_colours() -> dict[str, str]:
    """The viewer's colours by what they stand for, each for a light page and a dark one (CSS)."""
    pairs = {f"leg-{leg}": pair for leg, pair in enumerate(_GROUPS, 1)}
    pairs |= _ENERGY_COLOURS | {"ground": (GROUND_COLOUR, "#B9B9B9")}
    return {name: f"light-dark({light}, {dark})" for name, (light, dark) in pairs.items()}


MARKERS = "osD^vPX"
"""Of kinds of points, in the order in which they take them."""


def colour_of(k: int) -> str:
    """The colour of the k-th kind of line."""
    return COLOURS[k % len(COLOURS)]


def marker_of(k: int) -> str:
    """The marker of the k-th kind of points; with their colours, they repeat after 49."""
    return MARKERS[(k + k // len(COLOURS)) % len(MARKERS)]


def line_of(k: int) -> dict[str, Any]:
    """Colour and style of the k-th kind of line, for `Axes.plot`: it holds without colour."""
    return {"color": colour_of(k), "linestyle": LEG_STYLES[k % len(LEG_STYLES)]}


class Look(NamedTuple):
    """How a body, a foot or a leg is drawn.

    Attributes:
        group: number of its leg, or behind these of a body that is in none.
        depth: how many bodies of its leg it hangs on.
    """

    group: int
    depth: int = 0

    @property
    def colour(self) -> str:
        """Its leg's, the paler the farther from the root point."""
        share = _FADES**self.depth
        base = LEG_COLOURS[self.group % len(LEG_COLOURS)]
        parts = (int(base[k : k + 2], 16) for k in (1, 3, 5))
        return "#" + "".join(f"{round(255 - share * (255 - part)):02X}" for part in parts)

    @property
    def line(self) -> dict[str, Any]:
        """Colour and style for `Axes.plot`."""
        style = LEG_STYLES[self.group % len(LEG_STYLES)]
        return {"color": self.colour, "linestyle": style}

    @property
    def words(self) -> str:
        """Its classes in the viewer's style sheet."""
        leg = f"leg-{1 + self.group % len(LEG_COLOURS)}"
        return leg + (f" deep-{min(self.depth, 3)}" if self.depth else "")


def label_of(name: str, noun: str) -> str:
    """What legends call what has this name: a bare number, say, is "leg 1"."""
    return name if name[0].isalpha() else f"{noun} {name}"


def axes_or_new(ax: Axes | None, width: float, height: float, *, aside: float = 0.0) -> Axes:
    """The axes given, or those of a new figure, of which a legend `aside` takes so much width."""
    return new_figure(width, height, aside=aside).add_subplot() if ax is None else ax


def figure_of(ax: Axes) -> Figure:
    """The figure that axes belong to, also where they lie in a subfigure."""
    figure = ax.figure.figure
    assert isinstance(figure, Figure)
    return figure


def set_title(ax: Axes, title: str, *, panel: bool = False) -> None:
    """A title on the left; without titles (see `figure_style`) only those of panels."""
    if panel or has_titles():
        ax.set_title(title, loc="left", fontsize="medium")


def dress(ax: Axes, title: str, x_label: str, y_label: str, *, panel: bool = False) -> None:
    """Title, labels and a faint grid."""
    set_title(ax, title, panel=panel)
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
    """A legend in small letters without a frame. Default: within the axes.

    Its samples are long enough to show all dashes of a line, with which colours are distinguished.
    """
    lines = options.get("handles") or ax.get_legend_handles_labels()[0]
    options = {"handlelength": _sample_length(lines)} | options
    ax.legend(**{"frameon": False, "fontsize": "small"} | options)


def legend_below(ax: Axes, *, columns: int, **options: Any) -> None:
    """A legend under the axes and half an inch of labels, for more than fits beside the title.

    It has so many columns, or as many as the figure has room for.
    """
    entries, figure = _entries(ax, options), figure_of(ax)
    columns = _columns(figure, entries, columns)
    down = -0.5 * letter_size()
    under = ax.transAxes + ScaledTranslation(0.0, down, figure.dpi_scale_trans)
    place: dict[str, Any] = {"bbox_to_anchor": (0.5, 0.0), "bbox_transform": under}
    place |= {"loc": "upper center", "ncols": columns, "borderaxespad": 0.0, "handles": entries}
    legend(ax, **place | options)


def legend_of_figure(figure: Figure, entries: list[Any]) -> None:
    """A legend under all axes of a figure, in three columns or as many as there is room for."""
    columns = _columns(figure, entries, 3)
    look: dict[str, Any] = {"frameon": False, "fontsize": "small", "ncols": columns}
    look["handlelength"] = _sample_length(entries)
    figure.legend(handles=entries, loc="outside lower center", **look)


def _columns(figure: Figure, entries: list[Any], most: int) -> int:
    """How many columns of a legend a figure has room for; it makes room for their rows."""
    room = 0.88 * figure.get_figwidth() / letter_size()
    columns = max(1, min(most, len(entries), int(room / max(_widths(entries), default=room))))
    make_room(figure, -(-len(entries) // columns))
    return columns


def _sample_length(entries: list[Any]) -> float:
    """Length of a legend's samples of lines, in its letters' size."""
    dashes = [getattr(entry, "_dash_pattern", (0.0, None))[1] or (0.0,) for entry in entries]
    return max(2.0, 1.3 * max(map(sum, dashes), default=0.0) / (8.33 * letter_size()))


_TITLE_LETTER, _ENTRY_LETTER, _ENTRY_SAMPLE = 0.066, 0.06, 0.5
"""Widths of a letter of titles, of one of legends, and of the sample before an entry [inches], of
letters of the usual size."""


def _entries(ax: Axes, options: dict[str, Any]) -> list[Any]:
    """The handles among a legend's options, taken from these, or those of what is drawn."""
    return list(options.pop("handles", None) or ax.get_legend_handles_labels()[0])


def _widths(entries: list[Any]) -> list[float]:
    """Of a legend's entries [inches], of letters of the usual size."""
    letters = (_MATHEMATICS.sub("xx", str(each.get_label())) for each in entries)
    sample = _ENTRY_SAMPLE + 0.116 * (_sample_length(entries) - 2.0)
    return [sample + _ENTRY_LETTER * len(text) for text in letters]


def text_size(text: str) -> tuple[float, float]:
    """About how wide and how high lines of text are in small letters [inches]."""
    lines = _MATHEMATICS.sub("xxxx", text).split("\n")
    return _ENTRY_LETTER * letter_size() * max(map(len, lines)), 0.15 * letter_size() * len(lines)


_MATHEMATICS = re.compile(r"\$.*?\$")


def legend_above(
    ax: Axes, lowest: Axes | None = None, *, width: float | None = None, **options: Any
) -> None:
    """A legend in one row above the axes, right of the title, where it covers no data.

    Where the axes, whose width [inches] may be told, have no room for that, in rows below them or
    below the lowest of several axes.
    """
    entries = _entries(ax, options)
    if width is None:
        width = 1.1 * ax.get_window_extent().width / figure_of(ax).dpi
    needed = sum(_widths(entries)) + _TITLE_LETTER * len(ax.get_title(loc="left"))
    if letter_size() * needed > width:
        legend_below(lowest or ax, columns=len(entries), handles=entries, **options)
    else:
        row = {"handles": entries, "ncols": max(len(entries), 1), "bbox_to_anchor": (1.0, 1.0)}
        legend(ax, **{"loc": "lower right", "borderaxespad": 0.2} | row | options)


def legend_right(ax: Axes, **options: Any) -> None:
    """A legend right of the axes, for entries of many words; below them in a narrow figure."""
    if is_narrow():
        entries = _entries(ax, options)
        legend_below(ax, columns=len(entries), handles=entries)
        return
    legend(ax, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, **options)


_LABEL_COLOURS = {
    str(Label.FELL_FORWARD): "#D55E00",
    str(Label.FELL_BACK): "#F9C653",
    str(Label.STOPPED): "#2CC596",
    str(Label.STUMBLED): "#EAAACE",
    str(Label.SLID): "#F2E850",
    str(Label.OUT_OF_STEPS): "#484848",
    str(Label.SOLVER_FAILED): "#000000",
    str(Label.UNRESOLVED): "#2A2A2A",
    str(Label.TIMED_OUT): "#9A9A9A",
    str(Label.CHATTERS): "#6E4A20",
    str(Label.PENDING): "#F2F2F2",
}
"""Okabe and Ito's colours, greys where nothing is known, all of different lightness: they can be
distinguished by colour-blind readers, and in print without colour."""
_BLUES = ("#0072B2", "#56B4E9", "#0B3C5D", "#A6D8F5", "#1F5E96", "#1E90FF")
"""Walking: shades by gait, or else by the cycle's length; they repeat after six."""
_WALKING_MARKERS = "os8hpH"
_WALKING_PATTERNS = ("", "....", "ooo", "xxx", "+++", "***")
_MARKERS = "D^vPX*<>d."
_ORDER = list(_LABEL_COLOURS)
GAIT_SUFFIX = ", gait {gait}"
"""What follows the word for walking if several gaits are distinguished."""


def label_colour(name: str) -> str:
    """The colour of a label's name (`label_name`); grey for a name that is not known."""
    ends, place = _kind(name)
    return _LABEL_COLOURS.get(name, "#BBBBBB") if ends else _BLUES[place % len(_BLUES)]


def in_order(names: set[str]) -> list[str]:
    """Names in one order for all legends: walking, then the endings, pending last."""
    kinds = {name: _kind(name) for name in names}
    return sorted(names, key=lambda name: (kinds[name][0], math.prod(kinds[name]), name))


def walking_pattern(name: str) -> str:
    """The pattern over what walks in a further gait or a longer cycle; "" for all else.

    Blues alone have other labels' lightness.
    """
    ends, place = _kind(name)
    return "" if ends else _WALKING_PATTERNS[place % len(_WALKING_PATTERNS)]


def label_marker(name: str) -> str:
    """The marker of a label's name on a line, by which it is known without colour."""
    ends, place = _kind(name)
    markers = _MARKERS if ends else _WALKING_MARKERS
    return markers[place % len(markers)]


def _kind(name: str) -> tuple[bool, int]:
    """Whether it is an ending, and its place among these; or that of its gait or cycle's length."""
    if not name.startswith((str(Label.WALKING), PERIODIC)):
        return True, _ORDER.index(name) if name in _ORDER else len(_ORDER)
    numbers = re.findall(r"\d+", name) or [1]
    return False, int(numbers[-1]) - (len(numbers) == 1)

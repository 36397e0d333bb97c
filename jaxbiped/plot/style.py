"""Style that all figures share: colours, sizes, new figures, and where legends go."""

import math
import re
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from jaxbiped.basins._labels import Label

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
    pairs = {f"leg-{leg}": pair for leg, pair in enumerate(_GROUPS, 1)}
    pairs |= _ENERGY_COLOURS | {"ground": (GROUND_COLOUR, "#B9B9B9")}
    pages = ("light", "dark")
    return {f"{pages[k]}-{name}": pair[k] for k in (0, 1) for name, pair in pairs.items()}


def colour_of(k: int) -> str:
    """The colour of the k-th kind of line."""
    return COLOURS[k % len(COLOURS)]


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
    """A legend under the axes and half an inch of labels, for more than fits beside the title."""
    under = ax.transAxes + ScaledTranslation(0.0, -0.5, figure_of(ax).dpi_scale_trans)
    place: dict[str, Any] = {"bbox_to_anchor": (0.5, 0.0), "bbox_transform": under}
    legend(ax, loc="upper center", ncols=columns, borderaxespad=0.0, **place, **options)


_TITLE_LETTER, _ENTRY_LETTER, _ENTRY_SAMPLE = 0.066, 0.06, 0.5
"""Widths of a letter of titles, of one of legends, and of the sample before an entry [inches]."""


def legend_above(
    ax: Axes, lowest: Axes | None = None, *, width: float | None = None, **options: Any
) -> None:
    """A legend in one row above the axes, right of the title, where it covers no data.

    Where the axes, whose width [inches] may be told, have no room for that, in rows below them or
    below the lowest of several axes.
    """
    entries = options.pop("handles", None) or ax.get_legend_handles_labels()[0]
    figure = figure_of(ax)
    if width is None:
        width = 1.1 * ax.get_window_extent().width / figure.dpi
    widths = [_ENTRY_SAMPLE + _ENTRY_LETTER * len(str(each.get_label())) for each in entries]
    if sum(widths) + _TITLE_LETTER * len(ax.get_title(loc="left")) > width:
        columns = max(1, min(len(entries), int(0.8 * figure.get_figwidth() / max(widths))))
        legend_below(lowest or ax, columns=columns, handles=entries, **options)
    else:
        row = {"handles": entries, "ncols": max(len(entries), 1), "bbox_to_anchor": (1.0, 1.0)}
        legend(ax, **{"loc": "lower right", "borderaxespad": 0.2} | row | options)


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
    ends, place = _kind(name)
    return _LABEL_COLOURS.get(name, "#BBBBBB") if ends else _BLUES[place % len(_BLUES)]


def in_order(names: set[str]) -> list[str]:
    """Names in one order for all legends: walking, then the endings, pending last."""
    kinds = {name: _kind(name) for name in names}
    return sorted(names, key=lambda name: (kinds[name][0], math.prod(kinds[name]), name))


def label_marker(name: str) -> str:
    """The marker of a label's name on a line, by which it is known without colour."""
    ends, place = _kind(name)
    markers = _MARKERS if ends else _WALKING_MARKERS
    return markers[place % len(markers)]


def _kind(name: str) -> tuple[bool, int]:
    """Whether it is an ending, and its place among these; or that of its gait or cycle's length."""
    if not name.startswith(str(Label.WALKING)):
        return True, _ORDER.index(name) if name in _ORDER else len(_ORDER)
    numbers = [int(number) for number in re.findall(r"\d+", name)] or [1]
    return False, numbers[-1] - (len(numbers) == 1)

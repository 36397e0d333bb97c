"""Styles of figures: for a screen, or one or two columns of a paper wide."""

import contextlib
import contextvars
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._files import check_writable_file, user_path

FIGURE_FORMATS = ("png", "pdf", "svg")
"""Formats in which figures are written."""


class FigureStyle(NamedTuple):
    """Style of figures.

    Attributes:
        widths: width of figures of one column and two columns [inches]; each figure's own if None.
        font: size of the letters [points].
        dots: dots per inch of pictures made of dots.
        titles: whether a figure with one pair of axes has a title; papers have captions instead.
        settings: further settings of matplotlib.
    """

    widths: tuple[float, float] | None
    font: float
    dots: int
    titles: bool
    settings: dict[str, Any]


FIGURE_STYLES = {
    "screen": FigureStyle(None, 10.0, 120, True, {}),
    "paper": FigureStyle(
        (3.4, 7.0),
        8.0,
        300,
        False,
        {
            "axes.linewidth": 0.6,
            "xtick.major.width": 0.6,
            "ytick.major.width": 0.6,
            "xtick.minor.width": 0.4,
            "ytick.minor.width": 0.4,
        },
    ),
}
"""By name; a paper's widths are those of the American Physical Society's columns."""

_EMBEDDED: Any = {
    # TrueType, which publishers ask for; letters of an SVG are curves, so no font need be there.
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "svg.fonttype": "path",
    # The same figure makes the same file.
    "svg.hashsalt": "jaxbiped",
}
_UNDATED = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}


class _Chosen(NamedTuple):
    """A style and how many columns it spans."""

    style: FigureStyle = FIGURE_STYLES["screen"]
    columns: int = 1

    @property
    def width(self) -> float | None:
        """Width of figures [inches]; their own if None."""
        return self.style.widths and self.style.widths[self.columns - 1]

    def settings(self) -> Any:
        """Matplotlib's settings for it."""
        if self.width is None:
            return {}
        size = self.width, self.width * (0.75 if self.columns == 1 else 0.5)
        new = {"font.size": self.style.font, "figure.figsize": size, "savefig.dpi": self.style.dots}
        return new | {"figure.constrained_layout.use": True} | _EMBEDDED | self.style.settings


_USUAL = _Chosen()
_CHOSEN: contextvars.ContextVar[_Chosen] = contextvars.ContextVar("style", default=_USUAL)


@contextlib.contextmanager
def figure_style(style: str = "screen", *, columns: int = 1) -> Iterator[None]:
    """A context in which new figures are made in a style, also those of `pyplot`.

    The height of a figure of your own is 3/4 of its width, or half of it with two columns. Its
    fonts are embedded if it is saved within the context, or by `save_figure`.

    Args:
        style: "screen", or "paper": 3.4 inches (one column) or 7 inches (two columns) wide, letters
            of 8 points, no titles, 300 dots per inch in PNG.
        columns: number of columns of a paper that a figure spans, 1 or 2.

    Returns:
        A context; figures made in it keep its style.

    Raises:
        ArgumentError: the style is unknown, or the number of columns is not 1 or 2.

    Examples:
        >>> import jaxbiped as jb
        >>> with jb.plot.figure_style("paper"):
        ...     figure = jb.plot.friction_law(jb.seed_scene().friction)
        >>> float(figure.get_figwidth())
        3.4
    """
    check_choice("style", style, FIGURE_STYLES)
    if columns not in (1, 2):
        raise ArgumentError(f"columns = {columns!r} is not allowed: it must be 1 or 2.")
    chosen = _Chosen(FIGURE_STYLES[style], columns)
    before = _CHOSEN.set(chosen)
    try:
        with mpl.rc_context(chosen.settings()):
            yield
    finally:
        _CHOSEN.reset(before)


def has_titles() -> bool:
    """Whether figures of one pair of axes have titles."""
    return _CHOSEN.get().style.titles


def letter_size() -> float:
    """Font size relative to the usual one, with which sizes in inches are scaled."""
    return float(mpl.rcParams["font.size"]) / FIGURE_STYLES["screen"].font


def panels_abreast(most: int, *, width: float) -> int:
    """How many panels, each at least so wide [inches] at usual letters, stand side by side."""
    room = _CHOSEN.get().width
    return most if room is None else max(1, min(most, int(room / (width * letter_size()))))


def is_narrow() -> bool:
    """Whether new figures are one column wide, too narrow for a legend beside the axes."""
    chosen = _CHOSEN.get()
    return chosen.width is not None and chosen.columns == 1


_LABELS = 1.0
"""Height that labels and a legend take of a figure at usual letters [inches]."""
_ROW = 0.17
"""Height of a row of a legend at usual letters [inches]."""


def new_figure(
    width: float = 6.4, height: float = 4.0, *, rows: bool = False, aside: float = 0.0
) -> Figure:
    """A figure [inches] that knows how to draw itself, apart from pyplot's list of figures.

    In a paper's style the width is the column's. The height follows it, but for the labels'; where
    the figure is made of `rows` of words it follows the letters alone. A legend that takes a width
    of `aside` beside the axes stands below them in a narrow figure (see `make_room`).
    """
    wanted = _CHOSEN.get().width
    if wanted is not None:
        if is_narrow():
            width -= aside
        if rows:
            height *= letter_size()
        else:
            height = max(height - _LABELS, 0.0) * wanted / width + _LABELS * letter_size()
        width = wanted
    return StyledFigure(width, height, _CHOSEN.get())


def make_room(figure: Figure, rows: int) -> None:
    """Makes a figure of a paper's style taller by the rows of a legend, but for the first one."""
    if isinstance(figure, StyledFigure) and _CHOSEN.get().width is not None:
        figure.set_figheight(figure.get_figheight() + _ROW * letter_size() * (rows - 1))


class StyledFigure(Figure):
    """A figure that is drawn and written under the settings that it was made under."""

    def __init__(self, width: float, height: float, chosen: _Chosen) -> None:
        super().__init__(figsize=(width, height), dpi=120, layout="constrained")
        self._chosen = chosen
        FigureCanvasAgg(self)

    def draw(self, renderer: Any) -> None:
        """Draws it; ticks, which are made only now, have its letters."""
        with mpl.rc_context(self._chosen.settings()):
            super().draw(renderer)

    def savefig(self, fname: Any, **options: Any) -> None:
        """Writes it, with fonts embedded."""
        with mpl.rc_context(self._chosen.settings() | _EMBEDDED):
            # Axes of equal scales move within the first layout; drawing lays out once more.
            if layout := self.get_layout_engine():
                layout.execute(self)
            super().savefig(fname, **{"dpi": self._chosen.style.dots} | options)


def save_figure(
    figure: Figure,
    path: str | Path,
    *,
    formats: str | tuple[str, ...] | list[str] | None = None,
    dpi: float | None = None,
) -> list[Path]:
    """Writes a figure with embedded fonts (Type 42 in PDF, curves in SVG), the same file each time.

    Args:
        figure: any matplotlib figure.
        path: path of the file; its ending determines the format if `formats` is omitted.
        formats: some of "png", "pdf" and "svg"; "png" if the path has no such ending either.
        dpi: dots per inch. Default: those of the figure's style.

    Returns:
        Paths of the files, one for each format.

    Raises:
        ArgumentError: an unknown format, or a path where no file can be written.
    """
    path = user_path(path)
    ending = path.suffix.removeprefix(".").lower()
    stem = path.with_suffix("") if ending in FIGURE_FORMATS else path
    if formats is None:
        is_format = ending in figure.canvas.get_supported_filetypes()
        formats = (ending,) if is_format else ("png",)
    if isinstance(formats, str):
        formats = (formats,)
    written = []
    for each in formats:
        check_choice("formats", each, FIGURE_FORMATS)
        where = check_writable_file("path", stem.with_name(f"{stem.name}.{each}"))
        with mpl.rc_context(_EMBEDDED):
            own: dict[str, Any] = {} if dpi is None else {"dpi": dpi}
            figure.savefig(where, metadata=_UNDATED.get(each), **own)
        written.append(where)
    return written

"""What a figure shows: its labels, its lines, and whether anybody could see them."""

import contextlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

_UNIT = re.compile(r"\(.+\)")


LEGS = np.array([[0x00, 0x72, 0xB2], [0xD5, 0x5E, 0x00]])
"""Colours of leg 1 and leg 2, wherever they are drawn."""


@contextlib.contextmanager
def saved_figures():
    """The figures that are saved meanwhile, by the names of their files."""
    figures, save = {}, Figure.savefig

    def kept(figure, target, *arguments, **options):
        if isinstance(target, str | Path):
            figures[Path(target).name] = figure
        return save(figure, target, *arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", kept)
        yield figures


def leg_pixels(path):
    """How many pixels of a picture's last frame have the colour of leg 1, and of leg 2."""
    with Image.open(path) as image:
        image.seek(getattr(image, "n_frames", 1) - 1)
        pixels = np.asarray(image.convert("RGB")).astype(int)
    return [int((abs(pixels - colour).max(axis=-1) < 8).sum()) for colour in LEGS]


def sent_in(page):
    """What a page that plays walks was given."""
    return json.loads(re.search(r'id="walks">(.*?)</script>', page)[1])


def labels_of(figure):
    """Labels of all axes that are seen, as a set of texts."""
    found = set()
    for ax in figure.axes:
        found |= {ax.get_xlabel(), ax.get_ylabel()}
    return found - {""}


def legend_of(ax):
    """The entries of an axes' legend, in words."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


def points_of(ax, label=None):
    """Points (n, 2) of all lines of an axes in their order, or of those with a label."""
    lines = [line for line in ax.lines if label is None or line.get_label() == label]
    return [np.asarray(line.get_xydata(), float) for line in lines]


def assert_ticks_apart(figure):
    """No two labels of ticks overlap, and none leaves the page."""
    FigureCanvasAgg(figure).draw()
    renderer, boxes = figure.canvas.get_renderer(), []
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis) if ax.get_visible() and ax.axison else ():
            low, high = sorted(axis.get_view_interval())
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            labels = [t for tick in ticks if low <= tick.get_loc() <= high for t in
                      (tick.label1, tick.label2) if t.get_visible() and t.get_text()]  # fmt: skip
            boxes += [(t.get_text(), t.get_window_extent(renderer)) for t in labels]
    for k, (text, box) in enumerate(boxes):
        assert box.x0 > -1.0, text
        assert box.x1 < figure.bbox.x1 + 1.0, text
        for other, its in boxes[k + 1 :]:
            across = min(box.x1, its.x1) - max(box.x0, its.x0)
            assert min(across, min(box.y1, its.y1) - max(box.y0, its.y0)) <= 0.0, (text, other)


def assert_is_drawn(figure, *, unitless=()):
    """Every axes shows something finite within its limits, and its labels say units.

    Labels may be left to an axes with the same ticks. `unitless` names those of bare numbers.
    """
    FigureCanvasAgg(figure).draw()
    shown = [ax for ax in figure.axes if ax.get_visible() and ax.axison]
    assert shown
    for ax in shown:
        assert _is_something_seen(ax), ax
    labels = labels_of(figure)
    assert labels
    bare = {label for label in labels if not _UNIT.search(label)}
    assert bare <= set(unitless), bare


def _is_something_seen(ax):
    """Whether any data of an axes' artists lies within its limits."""
    (left, right), (low, high) = sorted(ax.get_xlim()), sorted(ax.get_ylim())
    if not np.isfinite([left, right, low, high]).all() or left == right or low == high:
        return False
    window, renderer = ax.get_window_extent(), ax.get_figure(root=True).canvas.get_renderer()
    for artist in [*ax.lines, *ax.collections, *ax.patches, *ax.images]:
        if not artist.get_visible():
            continue
        box = artist.get_window_extent(renderer)
        if np.isfinite(box.extents).all() and window.overlaps(box):
            return True
    return False

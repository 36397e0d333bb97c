"""Looks of the labels of starts: colours, markers, patterns, and the order of legends."""

import math
import re

from jaxbiped.basins._labels import Label

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
    if not name.startswith(str(Label.WALKING)):
        return True, _ORDER.index(name) if name in _ORDER else len(_ORDER)
    numbers = re.findall(r"\d+", name) or [1]
    return False, int(numbers[-1]) - (len(numbers) == 1)

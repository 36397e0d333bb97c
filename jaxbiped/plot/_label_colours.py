"""One colour for each label, the same in every figure."""

import re

from jaxbiped.basins._label import Label

_COLOURS = {
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
_ORDER = list(_COLOURS)
GAIT_SUFFIX = ", gait {gait}"
"""Said after the name of what walks, where several gaits are told apart."""


def label_colour(name: str) -> str:
    """The colour of a label's name (`label_name`); grey for a name that is not known."""
    if not _walks(name):
        return _COLOURS.get(name, "#BBBBBB")
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

"""Gaits in a picture of basins: where they are in its plane, and whether their numbers matter."""

import json
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from jaxbiped._checks import ArgumentError, check_finite
from jaxbiped.basins._labels import Label
from jaxbiped.plot.style import GAIT_SUFFIX

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


def gait_marks(dataset: Any, x: str, y: str) -> list[GaitMark]:
    """The gaits of a sweep's dataset in the plane of two of its coordinates.

    A gait that lies off the plane, as its other coordinates are not those of the starts, is
    projected onto it, and its label says so.
    """
    settings = json.loads(dataset.attrs.get("settings", "{}"))
    fixed = {str(n): float(c) for n, c in dataset.coords.items() if not c.ndim and _is_number(c)}
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


def _is_number(coordinate: Any) -> bool:
    return coordinate.dtype.kind in "iuf"

"""Results and scenes as a notebook shows them: a small table and a picture, as HTML."""

import base64
import functools
import html
import io
import math
from collections.abc import Iterable

import jax.tree_util as jtu
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import check_type
from jaxbiped._types import is_traced
from jaxbiped.continuation._branch import Branch
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import QUANTITIES, Gait
from jaxbiped.gait._search_provenance import FoundBy
from jaxbiped.plot import style
from jaxbiped.plot._gait_charts import multipliers
from jaxbiped.plot._motion_curves import gait_orbit
from jaxbiped.plot._motion_pictures import corners_of, draw_bodies
from jaxbiped.plot._parameter_charts import branch
from jaxbiped.plot._samples import AnyScene
from jaxbiped.plot._skeleton import skeleton_of
from jaxbiped.plot._symbols import HEIGHT, HORIZONTAL
from jaxbiped.scene._parameter_access import parameter_quantities, parameter_values
from jaxbiped.scene._scene import AbstractWalkerScene

Rows = Iterable[tuple[str, ...]]

_STRIDE = 0.25
"""Angle of the first leg ahead, and of the others behind, in the picture of a walker [rad]."""
_DOTS = 80
"""Dots per inch of a picture: small files, still sharp at the size of a cell."""
_STABLE = {True: "stable", False: "not stable"}


def walker(scene: AnyScene, *, ax: Axes | None = None) -> Figure:
    """Draws a scene's walker in a stride on its slope: bodies, feet, hinges and names.

    Args:
        scene: the scene, compliant or rigid, in minimal or redundant coordinates.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: `scene` is not a scene of a walker.
    """
    check_type("scene", scene, AbstractWalkerScene)
    skeleton = skeleton_of(scene.mechanism)
    ahead = [-_STRIDE, *[_STRIDE] * len(skeleton.legs), 0.0]
    groups = [min(part.look.group, len(skeleton.legs)) for part in skeleton.parts]
    angles = [ahead[group if group < len(skeleton.legs) else -1] for group in groups]
    motion = {f"theta_{p.name}": np.full(1, a) for p, a in zip(skeleton.parts, angles, strict=True)}
    motion |= {f"{skeleton.root}_{name}": np.zeros(1) for name in "xz"}
    level = skeleton.pose(motion, 0.0)
    soles = zip(level.feet, skeleton.feet, strict=True)
    motion[f"{skeleton.root}_z"] = np.array([max(s.radius - float(f[0, 1]) for f, s in soles)])
    slope = float(scene.ground.slope)
    pose = skeleton.pose(motion, slope)
    corners = corners_of(skeleton, pose)
    ax = style.axes_or_new(ax, 4.2, 4.2)
    ax.axline((0.0, 0.0), slope=-math.tan(slope), color=style.GROUND_COLOUR)
    draw_bodies(ax, skeleton, pose)
    for hinge in pose.hinges:
        ax.plot(*hinge[0], "o", color=style.GROUND_COLOUR, markersize=4, zorder=4)
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlim(*corners[:, 0])
    ax.set_ylim(*corners[:, 1])
    style.dress(ax, f"Walker on a slope of {slope:.3g} rad", HORIZONTAL.on_axis(), HEIGHT.on_axis())
    style.legend_below(ax, columns=2)
    return style.figure_of(ax)


def notebook_html(shown: object) -> str:
    """HTML with which a notebook shows a gait, a branch or a scene; the `repr` of anything else.

    Args:
        shown: a `Gait`, a `Branch` or a scene. A batch, or an object under a transformation of JAX,
            is shown without a picture.

    Returns:
        HTML with an embedded picture, some ten thousand characters.
    """
    if is_traced(shown):
        return _plain(shown)
    return _html_of(shown)


@functools.singledispatch
def _html_of(shown: object) -> str:
    return _plain(shown)


def _plain(shown: object) -> str:
    return f"<pre>{html.escape(repr(shown))}</pre>"


@_html_of.register(Gait)
def _of_gait(gait: Gait) -> str:
    if np.ndim(gait.ending):
        return _plain(gait)
    found = gait.outcome is Search.FOUND
    rows: list[tuple[str, ...]] = []
    for name, quantity in QUANTITIES.items():
        value = getattr(gait.measures, name)
        if value is not None and found:
            error = getattr(gait.measure_errors, name)
            rows.append(
                (name.replace("_", " "), *_with_error(float(value), float(error)), quantity.unit)
            )
    told = f"{gait.outcome} (jaxbiped.gait.explain_search(scene, gait) explains why)"
    if found:
        told = f"{_STABLE[bool(gait.stable)]}, found by {FoundBy(int(gait.origin.found_by))}"
    caption = f"Gait: {told}; its cycle is a {gait.cycle}"
    table = _table(caption, ("measure", "value", "error", "unit"), rows)
    return _beside(
        table, _gait_figure(gait) if found else None, "Orbit and multipliers of the gait"
    )


def _gait_figure(gait: Gait) -> Figure:
    """The orbit and the multipliers."""
    figure = style.new_figure(8.0, 4.2)
    left, right = figure.subplots(1, 2)
    gait_orbit(gait, ax=left)
    return multipliers(gait, ax=right)


@_html_of.register(Branch)
def _of_branch(found: Branch) -> str:
    rows = [(str(each.kind), *_with_error(each.value, each.value_error), found.unit)
            for each in found.bifurcations]  # fmt: skip
    ends = [(f"end: {each.end}", f"{each.value:.6g}", "", found.unit) for each in found.stops]
    caption = f"Branch of {len(found)} gaits along {found.along}"
    rows = [ends[0], *rows, ends[1]]
    table = _table(caption, ("bifurcation or end", found.along, "error", "unit"), rows)
    return _beside(table, branch(found) if len(found) else None, "Step length along the branch")


@_html_of.register(AbstractWalkerScene)
def _of_scene(scene: AnyScene) -> str:
    if any(np.ndim(leaf) for leaf in jtu.tree_leaves(scene)):
        return _plain(scene)
    values, quantities = parameter_values(scene), parameter_quantities(scene)
    rows = [
        (name, quantities[name].words, f"{float(values[name]):.6g}", quantities[name].unit_in_text)
        for name in values
    ]
    parts = [type(scene).__name__, type(scene.walker).__name__]
    parts += [
        type(getattr(scene.minimal, name)).__name__
        for name in ("normal", "friction")
        if getattr(scene.minimal, name, None) is not None
    ]
    caption = f"{parts[0]}: {', '.join(parts[1:])}"
    table = _table(caption, ("parameter", "", "value", "unit"), rows)
    return _beside(table, walker(scene), "The scene's walker in a stride on its slope")


def _with_error(value: float, error: float) -> tuple[str, str]:
    """A value to the digits that its error leaves, and the error."""
    if not (math.isfinite(error) and 0.0 < error < abs(value)):
        return f"{value:.9g}", "" if not math.isfinite(error) else f"{error:.1g}"
    places = max(0, 1 - math.floor(math.log10(error)))
    return f"{value:.{min(places, 12)}f}", f"{error:.1g}"


def _table(caption: str, head: tuple[str, ...], rows: Rows) -> str:
    def line(cells: tuple[str, ...], tag: str) -> str:
        return "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells)

    body = "".join(f"<tr>{line(cells, 'td')}</tr>" for cells in rows)
    top = f"<thead><tr>{line(head, 'th')}</tr></thead><tbody>{body}</tbody>" if body else ""
    return f'<table><caption style="text-align:left">{html.escape(caption)}</caption>{top}</table>'


def _beside(table: str, figure: Figure | None, alt: str) -> str:
    picture = ""
    if figure is not None:
        written = io.BytesIO()
        figure.savefig(written, format="png", dpi=_DOTS)
        data = base64.b64encode(written.getvalue()).decode()
        look = "max-width:100%;height:auto"
        picture = f'<img alt="{alt}" style="{look}" src="data:image/png;base64,{data}">'
    box = "display:flex;flex-wrap:wrap;gap:16px;align-items:flex-start"
    scrolls = "max-height:22em;overflow:auto"
    return f'<div style="{box}"><div style="{scrolls}" tabindex="0">{table}</div>{picture}</div>'

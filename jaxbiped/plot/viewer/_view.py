"""Views of walks and basins: what shows them, as a page of HTML without a network or in a notebook.

In a view of a basin, a start that is picked shows its walk.
"""

import abc
import dataclasses
import html
import json
import re
import warnings
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_count, check_type
from jaxbiped._files import check_writable_file
from jaxbiped._types import JsonObject
from jaxbiped.basins._labels import label_names
from jaxbiped.measure._samples import from_start
from jaxbiped.plot.style import in_order, label_colour, view_colours
from jaxbiped.plot.viewer._recording import Recording, base64_of, record_rigid_walk, record_walk
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import RigidState
from jaxbiped.simulate._simulate import simulate
from jaxbiped.simulate._trajectory import Trajectory, check_scene_of
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep.starts._coordinates import coordinate_quantities
from jaxbiped.sweep.starts._starts import Grid

if TYPE_CHECKING:
    import xarray

_MODULES = (
    "dom", "channels", "pose", "stage", "chart", "linked_charts", "player", "step_table", "view",
    "basin", "simulator", "playground",
)  # fmt: skip
"""In the order of their imports."""
_IMPORT = re.compile(r'^import \{[^}]*\} from "\./\w+\.js";\n', re.MULTILINE)
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'{more}; style-src 'unsafe-inline'; img-src data:"
)
_PAGE = """\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
body {{ margin: 0; }}
@media (prefers-color-scheme: dark) {{ body {{ background: #16181d; color: #f0f0f0; }} }}
{style}</style>
</head>
<body>
<main><noscript>This page plays a walk, which takes JavaScript.</noscript></main>
<script type="application/json" id="walks">{walks}</script>
<script type="module">
{script}showPage();
</script>
</body>
</html>
"""


class AbstractPage(abc.ABC):
    """Content of one page of HTML, which a notebook shows in a frame."""

    _computes: ClassVar[bool] = False
    """Whether the page runs WebAssembly."""

    @abc.abstractmethod
    def sent(self) -> JsonObject:
        """What the page is given, ready for JSON."""

    @abc.abstractmethod
    def _frame(self) -> tuple[str, int]:
        """Title of the page, and the height of its frame [px]."""

    def html(self) -> str:
        """A self-contained page of HTML that needs no network."""
        return page_of(self.sent(), self._frame()[0], computes=self._computes)

    def save(self, path: str | Path) -> Path:
        """Writes the page as a file, and returns its path."""
        where = check_writable_file("path", path)
        where.write_text(self.html(), encoding="utf-8")
        return where

    def _in_frame(self) -> str:
        """The page in a frame, for a notebook."""
        title, height = self._frame()
        return (
            f'<iframe srcdoc="{html.escape(self.html())}" sandbox="allow-scripts" '
            f'title="{html.escape(title)}" '
            f'style="width: 100%; height: {height}px; border: 0; resize: vertical"></iframe>'
        )


def page_of(sent: JsonObject, title: str, *, computes: bool = False) -> str:
    """A page of HTML that holds everything: what `showWalks` is sent, its script and its look."""
    return _PAGE.format(
        policy=_POLICY.format(more=" 'wasm-unsafe-eval'" if computes else ""),
        title=html.escape(title),
        style=asset("view.css"),
        # No text within ends the script.
        walks=json.dumps(sent, allow_nan=False).replace("<", "\\u003c"),
        script=script(*_MODULES, "page"),
    )


def script(*modules: str) -> str:
    """Modules of the viewer as one, behind each other: their names are known to all."""
    parts = [_IMPORT.sub("", asset(f"{name}.js")) for name in modules]
    return re.sub(r"^export ", "", "".join(parts), flags=re.MULTILINE)


def widget_script() -> str:
    """The viewer as a module for `anywidget`."""
    return script(*_MODULES, "widget") + "\nexport default { render };\n"


def asset(name: str) -> str:
    """The text of one of the viewer's files."""
    return files("jaxbiped.plot.viewer").joinpath("assets", name).read_text(encoding="utf-8")


@dataclasses.dataclass(frozen=True)
class View(AbstractPage):
    """One or several walks to watch, side by side with one clock. A notebook displays it.

    Attributes:
        recordings: recordings of the walks.
    """

    recordings: tuple[Recording, ...]

    def sent(self) -> JsonObject:
        """Data of page and widget, ready for JSON."""
        return {
            "walks": [each.numbers() for each in self.recordings],
            "colours": view_colours(),
        }

    def _frame(self) -> tuple[str, int]:
        names = ", ".join(each.name for each in self.recordings)
        return names, 620 * -(-len(self.recordings) // 2)

    def widget(self) -> Any:
        """The view as a widget of `anywidget` (`pip install jaxbiped[view]`).

        Its `time` [s] follows the page and moves it; its `sent` may be set to another view's
        `sent()`.

        Raises:
            ModuleNotFoundError: anywidget is not installed.
        """
        import anywidget
        import traitlets

        looks = {"_esm": widget_script(), "_css": asset("view.css")}
        shared: dict[str, Any] = {"sent": traitlets.Dict(), "time": traitlets.Float(0.0)}
        synced = {name: trait.tag(sync=True) for name, trait in shared.items()}
        return type("ViewWidget", (anywidget.AnyWidget,), looks | synced)(sent=self.sent())

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """What a notebook shows: the widget, or the page in a frame where there is no anywidget."""
        if find_spec("anywidget") is not None:
            return self.widget()._repr_mimebundle_(**options)
        return {"text/html": self._in_frame(), "text/plain": repr(self)}

    def __repr__(self) -> str:
        told = ", ".join(f"{each.name}: {each.ending}" for each in self.recordings)
        return f"View({told})"


def view(
    scene: Scene | RedundantScene | RigidScene,
    trajectory: Trajectory[Any],
    *,
    start: RigidState | None = None,
    name: str = "walk",
) -> View:
    """A view of a walk that can be played and scrubbed, with forces, footprints and linked charts.

    Positions between the stored times agree with `trajectory.at` to 1e-5 of a leg's length. Forces
    and energies have the accuracy of the drawing.

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, saved step by step; of a rigid walk, the steps or heel strikes.
        start: start of a rigid walk whose heel strikes alone were saved. Default: it is shown from
            the first of these on.
        name: name of the walk.

    Returns:
        The view. A notebook displays it, and `save(path)` writes it as one HTML page.

    Raises:
        ArgumentError: an argument has the wrong type, or a rigid walk has no heel strikes or start.
        ValueError: the trajectory was not saved step by step, or this is a batch.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.seed_scene()
        >>> how = dict(footsteps=2, accuracy="draft", engine="lanes")
        >>> walk = jb.simulate(scene, jb.seed_state(), **how)
        >>> jb.plot.view(scene, walk).html().startswith("<!doctype html>")
        True
    """
    check_type("scene", scene, Scene, RedundantScene, RigidScene)
    check_scene_of(trajectory, scene)
    if isinstance(scene, RigidScene):
        walk = trajectory if start is None else from_start(scene, trajectory, start)
        return View((record_rigid_walk(scene, walk, name),))
    if start is not None:
        raise ArgumentError(
            "start is allowed only with a rigid walk: this walk contains its start."
        )
    return View((record_walk(scene, trajectory, name),))


def side_by_side(*views: View) -> View:
    """Several walks side by side with one clock, with their charts on the same axes.

    Args:
        views: views from `view`, in order, each with its own name.

    Returns:
        One view of all walks.

    Raises:
        ArgumentError: there is no view, or an argument is something else.
    """
    if not views:
        raise ArgumentError("views is empty, which is not allowed: give at least one.")
    for each in views:
        check_type("views", each, View)
    return View(tuple(walk for each in views for walk in each.recordings))


@dataclasses.dataclass(frozen=True)
class BasinView(AbstractPage):
    """A picture of a basin in which a selected start shows its walk.

    Attributes:
        basin: the picture, ready for JSON.
        recordings: walks of the stored starts, row by row; None if a walk cannot be simulated.
    """

    basin: JsonObject
    recordings: tuple[Recording | None, ...]

    def sent(self) -> JsonObject:
        """Data of the page, ready for JSON."""
        walks = [each and each.numbers() for each in self.recordings]
        return {"basin": self.basin, "walks": walks, "colours": view_colours()}

    def _frame(self) -> tuple[str, int]:
        return self.basin["title"], 900

    _repr_html_ = AbstractPage._in_frame


def view_basin(
    labelling: Labelling,
    starts: Grid,
    found: "xarray.Dataset",
    *,
    most: int = 250,
    footsteps: int = 3,
    title: str = "Basin of attraction",
) -> BasinView:
    """Makes a picture of a basin in which a selected start shows its walk.

    The walks of evenly chosen starts are simulated at draft accuracy and stored in the page: their
    motion to 1e-4 of a leg's length, without forces.

    Args:
        labelling: labelling of the starts, of a compliant walker.
        starts: a grid with two axes, the second along the page.
        found: their labels, from `jaxbiped.sweep`.
        most: maximum number of walks to store, about 4 kB each.
        footsteps: number of footsteps of each walk.
        title: title of the picture.

    Returns:
        The view: `save(path)` writes it as one page of HTML, a notebook shows it in a frame.

    Raises:
        ArgumentError: an argument has the wrong type, the grid does not have two axes of at least
            two starts, the walker is rigid, or labels have another shape.
    """
    check_type("labelling", labelling, Labelling)
    check_type("starts", starts, Grid)
    check_count("most", most)
    check_count("footsteps", footsteps)
    if isinstance(labelling.scene, RigidScene):
        raise ArgumentError("labelling.scene is rigid, which is not allowed: give a compliant one.")
    if len(starts.shape) != 2 or min(starts.shape) < 2 or found.label.shape != starts.shape:
        raise ArgumentError(
            f"starts has shape {starts.shape} and found {found.label.shape}, which is not allowed: "
            "both must be of the same two axes, two starts or more along each."
        )
    rows, columns = _even_choice(starts.shape, most)
    numbers = np.ravel(rows[:, None] * starts.shape[1] + columns)
    words = label_names(found.label.values, found.cycle_footsteps.values)
    names = in_order(set(words.ravel().tolist()))
    y, x = starts.values
    quantities = coordinate_quantities(labelling.scene)
    labels = [
        f"{each.words} ({each.unit})" if each.unit else each.words
        for each in (quantities[x], quantities[y])
    ]
    # One that walks is shown at first, if there is one.
    walking = np.argwhere(np.char.startswith(words[np.ix_(rows, columns)].astype(str), "walking"))
    first = walking[len(walking) // 2, ::-1].tolist() if len(walking) else [0, 0]
    picture = {
        "title": title,
        "x": starts.values[x].tolist(),
        "y": starts.values[y].tolist(),
        "xLabel": labels[0],
        "yLabel": labels[1],
        "names": names,
        "colours": [label_colour(name) for name in names],
        "cells": base64_of(np.vectorize(names.index)(words), "<u1"),
        "columns": columns.tolist(),
        "rows": rows.tolist(),
        "first": first,
    }
    return BasinView(picture, tuple(_walks(labelling, starts, numbers, footsteps)))


def _even_choice(shape: tuple[int, ...], most: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of an even choice of at most so many starts, as many along each axis."""
    side = max(int(np.sqrt(most)), 1)
    counts = [min(side, size) for size in shape]
    for k in (0, 1):
        counts[k] = max(min(most // counts[1 - k], shape[k]), 1)
    rows, columns = (
        np.unique(np.round((np.arange(count) + 0.5) / count * size - 0.5).astype(int))
        for count, size in zip(counts, shape, strict=True)
    )
    return rows, columns


def _walks(
    labelling: Labelling, starts: Grid, numbers: np.ndarray, footsteps: int
) -> list[Recording | None]:
    batch = starts.at(labelling, numbers)
    found: list[Recording | None] = []
    for k in range(len(numbers)):
        here = {name: float(column[k]) for name, column in batch.parameters.items()}
        scene: Any = with_parameters(labelling.scene, here)
        state = jtu.tree_map(lambda leaf, k=k: leaf[k], batch.states)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                walk = simulate(scene, state, footsteps=footsteps, accuracy="draft")
            found.append(record_walk(scene, walk, "walk", motion_only=True))
        except ArgumentError:  # a start that no walk can have
            found.append(None)
    return found

"""Views of walks: what plays them, as one page of HTML without a network or in a notebook."""

import abc
import dataclasses
import html
import json
import re
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._files import check_writable_file
from jaxbiped._types import JsonObject
from jaxbiped.measure._samples import from_start
from jaxbiped.plot.style import view_colours
from jaxbiped.plot.viewer._recording import Recording, record_rigid_walk, record_walk
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import RigidState
from jaxbiped.solve._trajectory import Trajectory, check_scene_of

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
        trajectory: the motion, saved step by step; for a rigid walker, with its heel strikes
            (`max_arrivals`).
        start: start of a rigid walk. Default: the walk is shown from its first heel strike on.
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

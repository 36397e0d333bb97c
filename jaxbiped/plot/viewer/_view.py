"""Views of walks: what plays them, as a page or in a notebook."""

import dataclasses
from importlib.util import find_spec
from typing import Any

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import JsonObject
from jaxbiped.dynamics._state import RigidState
from jaxbiped.plot.style import view_colours
from jaxbiped.plot.viewer._page import AbstractPage, frame_of, page_of
from jaxbiped.plot.viewer._recording import Recording, record_walk
from jaxbiped.plot.viewer._rigid_recording import record_rigid_walk
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory


@dataclasses.dataclass(frozen=True)
class View(AbstractPage):
    """Walks that can be watched, side by side under one clock. A notebook shows it.

    Attributes:
        recordings: the walks as they are played.
    """

    recordings: tuple[Recording, ...]

    def sent(self) -> JsonObject:
        """What page and widget are given, ready for JSON."""
        return {
            "walks": [each.numbers() for each in self.recordings],
            "colours": view_colours(),
        }

    def html(self) -> str:
        """One page of HTML that holds everything and needs no network."""
        return page_of(self.sent(), ", ".join(each.name for each in self.recordings))

    def widget(self) -> Any:
        """The view as a widget of `anywidget` (`pip install jaxbiped[view]`).

        Its `time` [s] follows the page and moves it; its `sent` may be set to another view's
        `sent()`.

        Raises:
            ModuleNotFoundError: anywidget is not installed.
        """
        from jaxbiped.plot.viewer._widget import ViewWidget

        return ViewWidget(sent=self.sent())

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """What a notebook shows: the widget, or the page in a frame where there is no anywidget."""
        if find_spec("anywidget") is not None:
            return self.widget()._repr_mimebundle_(**options)
        frame = frame_of(self.html(), "walks", 620 * -(-len(self.recordings) // 2))
        return {"text/html": frame, "text/plain": repr(self)}

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
    """A walk to watch: played, scrubbed, with forces, footprints and linked charts.

    Positions between the times that are kept are those of `trajectory.at` to 1e-5 of a leg's
    length. Forces and energies are as exact as they are drawn.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step; of a rigid walker with its heel strikes, by
            `max_arrivals`.
        start: of a rigid walk, which otherwise is seen from its first heel strike on.
        name: what it is called.

    Returns:
        The view: a notebook shows it, `save(path)` writes it as one page of HTML.

    Raises:
        ArgumentError: arguments of the wrong type, or a rigid walk without heel strikes or start.
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
        return View((record_rigid_walk(scene, trajectory, start, name),))
    if start is not None:
        raise ArgumentError("start is only allowed with a rigid walk: this one knows its own.")
    return View((record_walk(scene, trajectory, name),))


def side_by_side(*views: View) -> View:
    """Several walks side by side under one clock, their charts on the same axes.

    Args:
        views: from `view`, in order, each with a name of its own.

    Returns:
        One view of all.

    Raises:
        ArgumentError: no view, or something else.
    """
    if not views:
        raise ArgumentError("views is empty, which is not allowed: give at least one.")
    for each in views:
        check_type("views", each, View)
    return View(tuple(walk for each in views for walk in each.recordings))

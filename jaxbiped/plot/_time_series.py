"""Time series: angles (paper, figure 6), penetrations (figure 7), any scalars of the state."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError, check_choice, check_positive, check_type
from jaxbiped._quantity import Quantity
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.dynamics._state import state_quantity
from jaxbiped.measure._samples import evaluate_along, from_start
from jaxbiped.plot import style
from jaxbiped.plot._samples import AnyScene, DrawnMotion, sample
from jaxbiped.plot._skeleton import Part, Sole, skeleton_of
from jaxbiped.plot._symbols import PENETRATION, TIME, angle_of
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.simulate._simulate import rigid_walk
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory


def leg_angles(scene: AnyScene, trajectory: Trajectory[Any], *, ax: Axes | None = None) -> Figure:
    """Draws the angles of all bodies from the slope's normal [rad] over time [s].

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved; for a rigid walker, its heel strikes.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step.
    """
    check_scene_of(trajectory, scene)
    (t, motion), skeleton = DrawnMotion(scene, trajectory).sampled(), skeleton_of(scene.mechanism)
    angles = [motion[f"theta_{part.name}"] for part in skeleton.parts]
    noun = skeleton.noun
    label = angle_of(noun).on_axis()
    title = f"{noun.capitalize()} angles" + " on rigid feet" * isinstance(scene, RigidScene)
    ax = _draw(ax, t, angles, skeleton.parts, title, label)
    return style.figure_of(ax)


def time_series(
    scene: AnyScene, trajectory: Trajectory[Any], *names: str, ax: Axes | None = None
) -> Figure:
    """Draws scalars of the state over time [s].

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved; for a rigid walker, its heel strikes.
        names: names of scalars of the state, or of angles and rates of bodies that couplings fix,
            all with one unit, such as `theta_torso`, `omega_shank_1` or `hip_vx`.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: there is no name, one is unknown, or the names have several units.
        ValueError: the trajectory was not saved step by step.
    """
    check_scene_of(trajectory, scene)
    t, known = DrawnMotion(scene, trajectory).sampled()
    skeleton = skeleton_of(scene.mechanism)
    if not names:
        raise ArgumentError(
            f"names is empty, which is not allowed: choose among {', '.join(known)}."
        )
    for name in names:
        check_choice("names", name, known)
    quantities = [state_quantity(name) or Quantity(name, "", "SI") for name in names]
    units = {each.unit for each in quantities}
    if len(units) > 1:
        raise ArgumentError(
            f"names = {names!r} is not allowed: they have the units {', '.join(sorted(units))}, "
            "but one pair of axes has only one unit."
        )
    ax = style.axes_or_new(ax, 7.2, 3.4)
    looks = {
        f"{word}_{part.name}": part.look for part in skeleton.parts for word in ("theta", "omega")
    }
    for k, (name, quantity) in enumerate(zip(names, quantities, strict=True)):
        look = looks[name].line if name in looks else style.line_of(k)
        ax.plot(t, known[name], linewidth=1.3, label=quantity.in_row(), **look)
    ax.margins(x=0.01)
    several = f"{_common_words(quantities)} ({quantities[0].unit_in_figure})"
    label = quantities[0].on_axis() if len(names) == 1 else several
    style.dress(ax, "Motion", TIME.on_axis(), label)
    style.legend_above(ax)
    return style.figure_of(ax)


def _common_words(quantities: Sequence[Quantity]) -> str:
    """The words that all begin with, without their last preposition."""
    lists = zip(*(each.words.split() for each in quantities), strict=False)
    shared = [words[0] for words in itertools.takewhile(lambda words: len(set(words)) == 1, lists)]
    while shared and shared[-1] in ("of", "leg", "along", "the"):
        shared.pop()
    return " ".join(shared) or "value"


def _draw(
    ax: Axes | None,
    t: npt.ArrayLike,
    values: Sequence[npt.ArrayLike],
    drawn: Sequence[Part | Sole],
    title: str,
    label: str,
) -> Axes:
    """Draws what bodies or feet have at times [s]."""
    ax = style.axes_or_new(ax, 7.2, 3.4)
    for each, value in zip(drawn, values, strict=True):
        ax.plot(t, value, linewidth=1.3, label=each.label, **each.look.line)
    ax.margins(x=0.01)
    style.dress(ax, title, TIME.on_axis(), label)
    style.legend_above(ax)
    return ax


def rigid_leg_angles(
    scene: RigidScene, state: Any, *, duration: float, ax: Axes | None = None
) -> Figure:
    """Draws the angles of all bodies of a rigid walk from its start, as `leg_angles` does.

    Args:
        scene: the walker.
        state: start of the walk.
        duration: duration to draw [s].
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: the duration is not above 0.
    """
    check_positive("duration", duration, "s")
    walk = rigid_walk(scene, state, duration=duration, max_arrivals=_MOST_STRIKES)
    return leg_angles(scene, from_start(scene, walk, state), ax=ax)


_MOST_STRIKES = 4096


def penetrations(scene: Scene, trajectory: Trajectory, *, ax: Axes | None = None) -> Figure:
    """Draws the penetration of each touching foot into the ground [mm] over time [s].

    A swing foot that the clearance rule lets pass below the surface does not touch, so its line is
    interrupted.

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step.
    """
    check_type("scene", scene, Scene, RedundantScene)
    check_scene_of(trajectory, scene)
    samples = sample(trajectory)
    found = evaluate_along(scene, samples.state, contacts)
    depths = [
        _depth_mm(np.asarray(foot.penetration), touching)
        for foot, touching in zip(found.feet, found.touching, strict=True)
    ]
    label = PENETRATION.on_axis("mm")
    feet = skeleton_of(scene.mechanism).feet
    ax = _draw(ax, samples.t, depths, feet, "Penetration of the feet", label)
    ax.set_ylim(0.0, 1.1 * float(np.nanmax(np.stack(depths), initial=1e-3)))
    return style.figure_of(ax)


def _depth_mm(penetration: np.ndarray, touching: np.ndarray) -> np.ndarray:
    """Penetration where the foot touches, zero at the samples just outside, nothing elsewhere."""
    beside = np.zeros_like(touching)
    beside[1:] |= touching[:-1]
    beside[:-1] |= touching[1:]
    at_surface = beside & ~touching & (penetration <= 0.0)
    return np.where(touching | at_surface, np.maximum(penetration, 0.0) * 1e3, np.nan)

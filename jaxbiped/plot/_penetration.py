"""Penetration of the feet over time (paper, figure 7)."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped.dynamics._contacts import contacts
from jaxbiped.measure._samples import evaluate_along
from jaxbiped.plot._samples import sample
from jaxbiped.plot._symbols import PENETRATION, TIME
from jaxbiped.plot.style import (
    LEG_COLOURS,
    LEG_NAMES,
    LEG_STYLES,
    axes_or_new,
    dress,
    figure_of,
    legend_above,
)
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory


def penetrations(scene: Scene, trajectory: Trajectory, *, ax: Axes | None = None) -> Figure:
    """Draws how deep each foot that touches is in the ground [mm] over time [s].

    A swing foot that the clearance rule lets pass under the surface does not touch: its line is
    interrupted.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step.
    """
    check_scene_of(trajectory, scene)
    samples = sample(trajectory)
    found = evaluate_along(scene, samples.state, contacts)
    ax = axes_or_new(ax, 7.2, 3.4)
    deepest = 0.0
    for k, (foot, touching) in enumerate(zip(found.feet, found.touching, strict=True)):
        depth = _depth_mm(np.asarray(foot.penetration), touching)
        look: dict[str, Any] = {"color": LEG_COLOURS[k], "linestyle": LEG_STYLES[k]}
        ax.plot(samples.t, depth, linewidth=1.3, label=LEG_NAMES[k], **look)
        deepest = max(deepest, float(np.nanmax(depth, initial=0.0)))
    ax.margins(x=0.01)
    ax.set_ylim(0.0, 1.1 * max(deepest, 1e-3))
    dress(ax, "Penetration of the feet", TIME.on_axis(), PENETRATION.on_axis("mm"))
    legend_above(ax)
    return figure_of(ax)


def _depth_mm(penetration: np.ndarray, touching: np.ndarray) -> np.ndarray:
    """Penetration where the foot touches, zero at the samples just outside, nothing elsewhere."""
    beside = np.zeros_like(touching)
    beside[1:] |= touching[:-1]
    beside[:-1] |= touching[1:]
    at_surface = beside & ~touching & (penetration <= 0.0)
    return np.where(touching | at_surface, np.maximum(penetration, 0.0) * 1e3, np.nan)

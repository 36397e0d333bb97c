"""Contacts over time: penetrations (paper, figure 7), forces (figure 8) and one heel strike."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped.dynamics._contacts import Contacts, contacts
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.measure._samples import evaluate_along
from jaxbiped.plot import style
from jaxbiped.plot._samples import Channels, Tolerances, adaptive_knots, sample, state_at
from jaxbiped.plot._skeleton import Sole, skeleton_of
from jaxbiped.plot._symbols import NORMAL_FORCE, PENETRATION, TANGENTIAL_FORCE, TIME
from jaxbiped.scene._scene import RedundantScene, Scene
from jaxbiped.simulate._trajectory import Trajectory, check_scene_of

_KINDS = ("normal", "tangential")
_EXACT = 1e-5
"""How far off straight lines between samples may be, in parts of the largest force of a kind."""
_SHORTEST = 1e-10
"""Interval of time that is not split further [s]."""
_BEFORE, _AFTER = 0.5e-3, 4.5e-3
"""What is enlarged around a heel strike [s]."""


def contact_forces(
    scene: Scene,
    trajectory: Trajectory,
    *,
    figure: Figure | SubFigure | None = None,
    strike: int = -1,
) -> Figure:
    """Draws the forces of the ground on all feet [N] over time.

    Left, the whole motion; right, one heel strike in milliseconds, with double support shaded.
    Above, the normal force; below, if there is friction, the tangential force, downhill positive.
    The points are so dense that straight lines between them are accurate to 1e-5 of the largest
    force (see `sampled_forces`), so peaks do not depend on where the solver's steps end.

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved.
        figure: empty figure or subfigure to draw into. Default: a new figure.
        strike: number of the heel strike to enlarge, counted from 0, or from the end with -1.
            Strikes less than 4.5 ms before the end, such as the one that ends a walk of some
            footsteps, are not counted. A motion without a strike has no right-hand column.

    Returns:
        The figure given, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step, or has fewer heel strikes.
    """
    check_type("scene", scene, Scene, RedundantScene)
    check_scene_of(trajectory, scene)
    t, forces = sampled_forces(scene, trajectory)
    times, legs = heel_strikes(scene, trajectory)
    legs, times = (each[times <= t[-1] - _AFTER] for each in (legs, times))
    if times.size and not -times.size <= strike < times.size:
        raise ArgumentError(
            f"strike = {strike} is not allowed: there are {times.size} heel strikes to enlarge."
        )
    rows = 2 if "tangential_1" in forces else 1
    columns = 2 if times.size else 1
    axes = _axes_of(figure, rows, columns)
    _draw_column(axes[:, 0], t, forces, skeleton_of(scene.mechanism).feet)
    axes[0, 0].margins(x=0.01)
    style.dress(axes[0, 0], "Contact forces", "", NORMAL_FORCE.on_axis())
    style.legend_above(axes[0, 0], axes[-1, 0])
    if rows == 2:
        style.dress(axes[1, 0], "", "", TANGENTIAL_FORCE.on_axis())
    axes[-1, 0].set_xlabel(TIME.on_axis())
    if times.size:
        if axes[0, 1].get_subplotspec().get_gridspec().ncols == 1:  # below, not beside
            for ax, kind in zip(axes[:, 1], (NORMAL_FORCE, TANGENTIAL_FORCE), strict=False):
                ax.set_ylabel(kind.on_axis())
        _draw_strike(axes[:, 1], scene, trajectory, times[strike], legs[strike] - 1)
    return style.figure_of(axes[0, 0])


def _axes_of(figure: Figure | SubFigure | None, rows: int, columns: int) -> np.ndarray:
    """Axes (rows, columns), each column with one time; one below the other where there is no room
    for both."""
    stacked = figure is None and columns > style.panels_abreast(columns, width=3.4)
    if stacked:
        figure = style.new_figure(4.6, 1.0 + 2.1 * rows * columns)
        axes = figure.subplots(rows * columns, 1).reshape(columns, rows).T
        for column in axes.T:
            for ax in column[:-1]:
                ax.sharex(column[-1])
                ax.tick_params(labelbottom=False)
        return axes
    if figure is None:
        figure = style.new_figure(4.6 * columns, 1.0 + 2.2 * rows)
    widths = [1.35, 1.0][:columns]
    found = figure.subplots(rows, columns, sharex="col", squeeze=False, width_ratios=widths)
    return np.asarray(found)


def forces_in(found: Contacts) -> Channels:
    """The forces [N] by their kinds and the numbers of the feet: "normal_1", "tangential_1"."""
    forces: Channels = {}
    for foot, force in enumerate(found.forces, 1):
        forces[f"normal_{foot}"] = np.asarray(force.normal)
        if force.tangential is not None:
            forces[f"tangential_{foot}"] = np.asarray(force.tangential)
    return forces


def sampled_forces(
    scene: Scene,
    trajectory: Trajectory,
    *,
    start: float | None = None,
    stop: float | None = None,
) -> tuple[np.ndarray, Channels]:
    """Times [s] of shape (n,) between two times, and the forces at them, as `forces_in` has them.

    The solver's steps follow the state, which does not feel how sharp a peak of the force is:
    where slip passes the peak of friction, the force has a corner and then loses two thirds of
    itself within half a microsecond, less than a step.
    """

    def evaluate(t: np.ndarray) -> Channels:
        return forces_in(evaluate_along(scene, state_at(trajectory, t), contacts))

    first = sample(trajectory, start=start, stop=stop).t
    largest: dict[str, float] = {}
    for name, force in (forces := evaluate(first)).items():
        kind = name.partition("_")[0]
        largest[kind] = max(largest.get(kind, 1e-9), float(np.abs(force).max()))
    allowed = {name: _EXACT * largest[name.partition("_")[0]] for name in forces}
    return adaptive_knots(evaluate, first, Tolerances({}, allowed, _SHORTEST))


def _draw_column(axes: np.ndarray, t: np.ndarray, forces: Channels, feet: Sequence[Sole]) -> None:
    for k, foot in enumerate(feet, 1):
        look = foot.look.line | {"linewidth": 1.1, "label": foot.label}
        for ax, kind in zip(axes, _KINDS, strict=False):
            ax.plot(t, forces[f"{kind}_{k}"], **look)


def _draw_strike(
    axes: np.ndarray, scene: Scene, trajectory: Trajectory, time: float, leg: int
) -> None:
    t, forces = sampled_forces(scene, trajectory, start=time - _BEFORE, stop=time + _AFTER)
    milliseconds, skeleton = (t - time) * 1e3, skeleton_of(scene.mechanism)
    _draw_column(axes, milliseconds, forces, skeleton.feet)
    normal = np.stack([forces[f"normal_{k}"] for k, _ in enumerate(skeleton.feet, 1)])
    feet_of_leg = scene.mechanism.structure.feet_of_leg
    carried = [(normal[list(feet)] > 0.0).any(axis=0) for feet in feet_of_leg]
    both = milliseconds[np.sum(carried, axis=0) > 1]
    look = {"color": style.SHADE_COLOUR, "linewidth": 0, "label": "double support"}
    for ax in axes:
        if both.size:
            ax.axvspan(both[0], both[-1], **look)
        ax.margins(x=0.0, y=0.2)
        style.dress(ax, "", "", ax.get_ylabel())
    style.set_title(axes[0], f"Heel strike of {skeleton.legs[leg]} at {time:.3f} s", panel=True)
    axes[-1].set_xlabel("time after the foot touches, $t$ (ms)")
    loaded = max(feet_of_leg[leg], key=lambda k: float(normal[k].max()))
    for ax, kind in zip(axes, _KINDS, strict=False):
        _mark_peak(ax, milliseconds, forces[f"{kind}_{loaded + 1}"])
    if both.size:
        style.legend(axes[0], handles=[axes[0].patches[-1]], loc="best")


def _mark_peak(ax: Axes, t: np.ndarray, force: np.ndarray) -> None:
    peak = int(np.argmax(np.abs(force)))
    text = f"{force[peak]:.4g} N".replace("-", "−")
    shift, anchor = (3, "bottom") if force[peak] > 0.0 else (-3, "top")
    style.label_point(ax, text, (float(t[peak]), float(force[peak])), (7, shift), va=anchor)


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
    feet = skeleton_of(scene.mechanism).feet
    ax = style.axes_or_new(ax, 7.2, 3.4)
    for foot, depth in zip(feet, depths, strict=True):
        ax.plot(samples.t, depth, linewidth=1.3, label=foot.label, **foot.look.line)
    ax.margins(x=0.01)
    style.dress(ax, "Penetration of the feet", TIME.on_axis(), PENETRATION.on_axis("mm"))
    style.legend_above(ax)
    ax.set_ylim(0.0, 1.1 * float(np.nanmax(np.stack(depths), initial=1e-3)))
    return style.figure_of(ax)


def _depth_mm(penetration: np.ndarray, touching: np.ndarray) -> np.ndarray:
    """Penetration where the foot touches, zero at the samples just outside, nothing elsewhere."""
    beside = np.zeros_like(touching)
    beside[1:] |= touching[:-1]
    beside[:-1] |= touching[1:]
    at_surface = beside & ~touching & (penetration <= 0.0)
    return np.where(touching | at_surface, np.maximum(penetration, 0.0) * 1e3, np.nan)

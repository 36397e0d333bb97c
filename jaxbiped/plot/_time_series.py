"""Time series: leg angles (paper, figure 6), penetration (figure 7), contact forces (figure 8)."""

from collections.abc import Sequence

import jax
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped._types import Scalar, as_array, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._contacts import Contacts, contacts
from jaxbiped.dynamics._state import RigidState
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.measure._samples import evaluate_along
from jaxbiped.plot import style
from jaxbiped.plot._samples import sample, sampled_forces
from jaxbiped.plot._symbols import LEG_ANGLE, NORMAL_FORCE, PENETRATION, TANGENTIAL_FORCE, TIME
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.simulate._simulate import rigid_walk
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory


def leg_angles(scene: Scene, trajectory: Trajectory, *, ax: Axes | None = None) -> Figure:
    """Draws both legs' angles from the slope's normal [rad] over time [s].

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
    t, state = sample(trajectory)
    ax = _draw_both(ax, t, (state.theta_1, state.theta_2), "Leg angles", LEG_ANGLE.on_axis())
    return style.figure_of(ax)


def _draw_both(
    ax: Axes | None, t: npt.ArrayLike, values: Sequence[npt.ArrayLike], title: str, label: str
) -> Axes:
    """Draws what leg 1 and leg 2 have at times [s]."""
    ax = style.axes_or_new(ax, 7.2, 3.4)
    for k, value in enumerate(values):
        ax.plot(t, value, linewidth=1.3, label=style.LEG_NAMES[k], **style.leg_line(k))
    ax.margins(x=0.01)
    style.dress(ax, title, TIME.on_axis(), label)
    style.legend_above(ax)
    return ax


_SAMPLES = 600


def rigid_leg_angles(
    scene: RigidScene, state: RigidState, *, duration: float, ax: Axes | None = None
) -> Figure:
    """Draws both legs' angles from the slope's normal [rad] over time [s].

    Each leg keeps its colour: the names that the footsteps exchange are exchanged back.

    Args:
        scene: the walker.
        state: start of the walk.
        duration: how long to draw [s].
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: a duration not above 0.
    """
    check_positive("duration", duration, "s")
    times = float(duration) * np.linspace(1.0 / _SAMPLES, 1.0, _SAMPLES)
    scene, state = jtu.tree_map(as_float, (scene, state))
    total, one, two = map(np.asarray, _walk_ends(scene, state, as_array(times)))
    odd = total % 2 == 1
    angles = (np.where(odd, two, one), np.where(odd, one, two))
    title = "Leg angles on rigid feet"
    return style.figure_of(_draw_both(ax, times, angles, title, LEG_ANGLE.on_axis()))


@cached_jit
def _walk_ends(
    scene: RigidScene, state: RigidState, times: Scalar
) -> tuple[Scalar, Scalar, Scalar]:
    """Of walks for these times [s]: how many feet came down, and the legs' last angles."""
    walks = jax.vmap(lambda t: rigid_walk(scene, state, duration=t))(times)
    assert walks.arrivals is not None
    return walks.arrivals.total, walks.final.theta_1, walks.final.theta_2


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
    depths = [
        _depth_mm(np.asarray(foot.penetration), touching)
        for foot, touching in zip(found.feet, found.touching, strict=True)
    ]
    label = PENETRATION.on_axis("mm")
    ax = _draw_both(ax, samples.t, depths, "Penetration of the feet", label)
    ax.set_ylim(0.0, 1.1 * float(np.nanmax(np.stack(depths), initial=1e-3)))
    return style.figure_of(ax)


def _depth_mm(penetration: np.ndarray, touching: np.ndarray) -> np.ndarray:
    """Penetration where the foot touches, zero at the samples just outside, nothing elsewhere."""
    beside = np.zeros_like(touching)
    beside[1:] |= touching[:-1]
    beside[:-1] |= touching[1:]
    at_surface = beside & ~touching & (penetration <= 0.0)
    return np.where(touching | at_surface, np.maximum(penetration, 0.0) * 1e3, np.nan)


_BEFORE, _AFTER = 0.5e-3, 4.5e-3
"""What is enlarged around a heel strike [s]."""


def contact_forces(
    scene: Scene,
    trajectory: Trajectory,
    *,
    figure: Figure | SubFigure | None = None,
    strike: int = -1,
) -> Figure:
    """Draws the forces of the ground on both feet [N] over time.

    Left, the whole motion; right, one heel strike in milliseconds, with double support shaded.
    Above, the normal force; below, the tangential one, downhill positive, where there is friction.
    Drawn at the solver's own steps and, about every peak, at times far closer together than
    these (see `sampled_forces`), so that peaks do not depend on where steps happen to end.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        figure: empty figure or subfigure to draw into; a new one unless given.
        strike: which heel strike to enlarge, counted from 0, or from the last: -1. A motion
            without a heel strike has no right-hand column.

    Returns:
        The figure given, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step, or has fewer heel strikes.
    """
    check_scene_of(trajectory, scene)
    t, found = sampled_forces(scene, trajectory)
    times, feet = heel_strikes(scene, trajectory)
    if times.size and not -times.size <= strike < times.size:
        raise ArgumentError(
            f"strike = {strike} is not allowed: this motion has {times.size} heel strikes."
        )
    rows = 1 if found.forces.foot_1.tangential is None else 2
    columns = 2 if times.size else 1
    if figure is None:
        figure = style.new_figure(4.6 * columns, 1.0 + 2.2 * rows)
    axes = figure.subplots(
        rows, columns, sharex="col", squeeze=False, width_ratios=[1.35, 1.0][:columns]
    )
    _draw_column(axes[:, 0], t, found)
    axes[0, 0].margins(x=0.01)
    style.dress(axes[0, 0], "Contact forces", "", NORMAL_FORCE.on_axis())
    style.legend_above(axes[0, 0])
    if rows == 2:
        style.dress(axes[1, 0], "", "", TANGENTIAL_FORCE.on_axis())
    axes[-1, 0].set_xlabel(TIME.on_axis())
    if times.size:
        _draw_strike(axes[:, 1], scene, trajectory, times[strike], feet[strike] - 1)
    whole = figure.figure
    assert isinstance(whole, Figure)
    return whole


def _draw_column(axes: np.ndarray, t: np.ndarray, found: Contacts) -> None:
    for k, force in enumerate(found.forces):
        look = style.leg_line(k) | {"linewidth": 1.1, "label": style.LEG_NAMES[k]}
        axes[0].plot(t, force.normal, **look)
        if force.tangential is not None:
            axes[1].plot(t, force.tangential, **look)


def _draw_strike(
    axes: np.ndarray, scene: Scene, trajectory: Trajectory, time: float, leg: int
) -> None:
    t, found = sampled_forces(scene, trajectory, start=time - _BEFORE, stop=time + _AFTER)
    milliseconds = (t - time) * 1e3
    _draw_column(axes, milliseconds, found)
    normal = [np.asarray(force.normal) for force in found.forces]
    both = milliseconds[found.both_carry]
    for ax in axes:
        if both.size:
            ax.axvspan(
                both[0], both[-1], color=style.SHADE_COLOUR, linewidth=0, label="double support"
            )
        ax.margins(x=0.0, y=0.12)
        style.dress(ax, "", "", "")
    axes[0].set_title(
        f"Heel strike of {style.LEG_NAMES[leg]} at {time:.3f} s", loc="left", fontsize="medium"
    )
    axes[-1].set_xlabel("time after the foot touches, $t$ (ms)")
    _mark_peak(axes[0], milliseconds, normal[leg])
    if len(axes) == 2:
        _mark_peak(axes[1], milliseconds, np.asarray(found.forces[leg].tangential))
    if both.size:
        axes[0].legend(handles=[axes[0].patches[-1]], loc="best", fontsize="small")


def _mark_peak(ax: Axes, t: np.ndarray, force: np.ndarray) -> None:
    peak = int(np.argmax(np.abs(force)))
    text = f"{force[peak]:.4g} N".replace("-", "−")
    shift, anchor = (3, "bottom") if force[peak] > 0.0 else (-3, "top")
    style.label_point(ax, text, (float(t[peak]), float(force[peak])), (7, shift), va=anchor)

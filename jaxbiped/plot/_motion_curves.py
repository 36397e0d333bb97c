"""Curves of a motion: over time (paper, figure 6), in the phase plane (figure 5), of a gait."""

import itertools
from collections.abc import Collection, Sequence
from typing import Any

import jax
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError, check_choice, check_positive
from jaxbiped._ending import Ending
from jaxbiped._quantity import Quantity
from jaxbiped.dynamics._state import state_quantity
from jaxbiped.gait._gait import Gait
from jaxbiped.measure._samples import from_start
from jaxbiped.plot import style
from jaxbiped.plot._gait_charts import check_drawable
from jaxbiped.plot._samples import AnyScene, DrawnMotion
from jaxbiped.plot._skeleton import Part, Skeleton, skeleton_of
from jaxbiped.plot._symbols import TIME, angle_of, rate_of
from jaxbiped.scene._scene import RigidScene
from jaxbiped.simulate._simulate import rigid_walk
from jaxbiped.simulate._trajectory import Trajectory, check_scene_of

_MOST_STRIKES = 4096
_PLACES = (0.12, 0.37, 0.62, 0.87)
"""Of the arrows, in parts of the curve's length."""
_FAINT = 0.35
"""Opacity of the whole walk, behind its last stride."""


def leg_angles(scene: AnyScene, trajectory: Trajectory[Any], *, ax: Axes | None = None) -> Figure:
    """Draws the angles of all bodies from the slope's normal [rad] over time [s].

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved; of a rigid walk, the steps or heel strikes.
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
    ax = style.axes_or_new(ax, 7.2, 3.4)
    for part, angle in zip(skeleton.parts, angles, strict=True):
        ax.plot(t, angle, linewidth=1.3, label=part.label, **part.look.line)
    ax.margins(x=0.01)
    style.dress(ax, title, TIME.on_axis(), label)
    style.legend_above(ax)
    return style.figure_of(ax)


def time_series(
    scene: AnyScene, trajectory: Trajectory[Any], *names: str, ax: Axes | None = None
) -> Figure:
    """Draws scalars of the state over time [s].

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved; of a rigid walk, the steps or heel strikes.
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


def phase_portrait(
    scene: AnyScene,
    trajectory: Trajectory[Any],
    *,
    ax: Axes | None = None,
    legs: tuple[int, ...] = (1,),
    bodies: Sequence[str] = (),
) -> Figure:
    """Draws the rate of bodies [rad/s] over their angle from the slope's normal [rad].

    A leg swings forward along the upper half and carries the walker along the lower half. The two
    nearly vertical ends are its heel strike (right) and its lifting (left). The whole walk is
    faint; the last stride is strong, from the leg's last heel strike but one to the end, if there
    are two. Arrows show the direction, a dot the start, and a cross the end of a walk that ended.

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved; of a rigid walk, the steps or heel strikes.
        ax: axes to draw into. Default: a new figure.
        legs: numbers of the legs to draw, counted from 1: (1,), (2,) or (1, 2).
        bodies: names of the bodies to draw instead, such as ("torso",).

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step, or a leg or a body does not exist.
    """
    check_scene_of(trajectory, scene)
    skeleton = skeleton_of(scene.mechanism)
    shown = _chosen(skeleton, legs, bodies)
    drawn = DrawnMotion(scene, trajectory)
    (t, motion), strikes = drawn.sampled(), drawn.strikes()
    ax = style.axes_or_new(ax, 5.8, 5.0)
    ended = trajectory.outcome != Ending.WALKING
    for part in shown:
        angle, rate = motion[f"theta_{part.name}"], motion[f"omega_{part.name}"]
        # What belongs to no leg strides with the first one.
        leg = part.look.group if part.look.group < len(skeleton.legs) else 0
        own = strikes.time_s[strikes.foot == leg + 1]
        since = float(own[-2]) if own.size > 1 else 0.0
        _draw_body(ax, part, t, angle, rate, since)
        if ended:
            ax.plot(angle[-1], rate[-1], "X", color=part.look.colour, markersize=9)
    # Marks that each body has in its own colour.
    for marker, words in [("X", str(trajectory.outcome))] * ended + [("o", "start")]:
        ax.plot([], [], marker, color=style.GROUND_COLOUR, label=words)
    noun = skeleton.noun
    style.dress(ax, "Phase portrait", angle_of(noun).on_axis(), rate_of(noun).on_axis())
    style.legend_below(ax, columns=2)
    return style.figure_of(ax)


def _chosen(skeleton: Skeleton, legs: tuple[int, ...], bodies: Sequence[str]) -> list[Part]:
    """The bodies of some legs, or those named; all where no body belongs to these legs alone."""
    for name in bodies:
        check_choice("bodies", name, [part.name for part in skeleton.parts])
    count = len(skeleton.legs)
    known = isinstance(legs, Collection) and set(legs) <= set(range(1, count + 1))
    if not bodies and not (known and legs):
        raise ArgumentError(
            f"legs = {legs!r} is not allowed: it must name some of the legs 1 to {count}, as (1,)."
        )
    chosen = [
        part
        for part in skeleton.parts
        if (part.name in bodies if bodies else part.look.group + 1 in legs)
    ]
    return chosen or list(skeleton.parts)


def _draw_body(
    ax: Axes, part: Part, t: np.ndarray, angle: np.ndarray, rate: np.ndarray, since: float
) -> None:
    """The whole walk, faint where a last stride is drawn over it."""
    look = part.look.line
    whole: dict[str, Any] = {"linewidth": 1.3, "label": part.label}
    last = t >= since
    if since > 0.0:
        whole = {"linewidth": 0.8, "alpha": _FAINT, "label": f"{part.label}, whole walk"}
    ax.plot(angle, rate, **look, **whole)
    if since > 0.0:
        label = f"last stride of {part.label}, from {since:.2f} s"
        ax.plot(angle[last], rate[last], linewidth=1.5, label=label, **look)
    _draw_arrows(ax, angle[last], rate[last], part.look.colour)
    ax.plot(angle[0], rate[0], "o", color=part.look.colour, markersize=5)


def gait_orbit(gait: Gait, *, ax: Axes | None = None) -> Figure:
    """Draws the rates of all bodies [rad/s] over their angles from the slope's normal [rad].

    The figure shows one cycle. If the cycle is a step, mirrored bodies are exchanged at each
    footstep, so the two curves of an odd number of footsteps form one closed curve. The dots are
    the bodies on the section, where the cycle begins. Arrows show the direction.

    Args:
        gait: a gait that was found, of any walker.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: no gait was found, or this is a batch.
    """
    check_drawable(gait)
    # Of the scene that a gait keeps, all numbers may be unknown: the names count.
    shapes = jax.eval_shape(lambda scene: scene.mechanism, gait.origin.nearest)
    mechanism = jtu.tree_map(lambda leaf: np.ones(leaf.shape), shapes)
    structure, skeleton = mechanism.structure, skeleton_of(mechanism)
    start = gait.measures.state
    ax = style.axes_or_new(ax, 5.6, 4.4)
    for body in structure.free:
        part, twin = skeleton.parts[body], (structure.body_twins or range(body + 1))[body]
        names = part.name, skeleton.parts[twin].name
        angle, rate = (_along_cycle(gait, word, *names) for word in ("theta", "omega"))
        ax.plot(angle, rate, linewidth=1.1, label=part.label, **part.look.line)
        _draw_arrows(ax, angle, rate, part.look.colour)
        begin = (float(getattr(start, f"{word}_{part.name}")) for word in ("theta", "omega"))
        ax.plot(*begin, "o", color=part.look.colour, markersize=6)
    noun = skeleton.noun
    title = "Periodic orbit (dots: on the section)"
    style.dress(ax, title, angle_of(noun).on_axis(), rate_of(noun).on_axis())
    style.legend_above(ax)
    return style.figure_of(ax)


def _along_cycle(gait: Gait, word: str, name: str, twin: str) -> np.ndarray:
    """Angle or rate of a body over the cycle, under its own name throughout.

    At each footstep it takes the name of its twin.
    """
    times, states = np.asarray(gait.orbit[0]), gait.orbit[1]
    own, others = (np.asarray(getattr(states, f"{word}_{each}")) for each in (name, twin))
    parts = [(others if k % 2 else own)[k, known] for k, known in enumerate(np.isfinite(times))]
    return np.concatenate(parts)


def _draw_arrows(ax: Axes, x: npt.ArrayLike, y: npt.ArrayLike, colour: str) -> None:
    """Puts arrow heads along a curve, evenly over its length as it is seen."""
    points = np.stack([np.asarray(x, dtype=float), np.asarray(y, dtype=float)], axis=-1)
    spans = np.ptp(points, axis=0)
    if len(points) < 2 or not (spans > 0.0).all():
        return
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*(np.diff(points, axis=0) / spans).T))])
    for place in _PLACES:
        ends = np.array([place - 0.004, place + 0.004]) * along[-1]
        tail, head = (tuple(np.interp(end, along, part) for part in points.T) for end in ends)
        look = {"arrowstyle": "-|>", "color": colour, "linewidth": 0.0, "mutation_scale": 15.0}
        ax.annotate("", head, tail, arrowprops=look | {"shrinkA": 0.0, "shrinkB": 0.0})

"""Phase portraits: bodies of a walk (paper, figure 5), and the periodic orbit of a gait."""

from collections.abc import Collection, Sequence
from typing import Any

import jax
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._ending import Ending
from jaxbiped.gait._gait import Gait
from jaxbiped.plot import style
from jaxbiped.plot._gait_charts import check_drawable
from jaxbiped.plot._samples import AnyScene, DrawnMotion
from jaxbiped.plot._skeleton import Part, Skeleton, skeleton_of
from jaxbiped.plot._symbols import angle_of, rate_of
from jaxbiped.solve._trajectory import Trajectory, check_scene_of

_PLACES = (0.12, 0.37, 0.62, 0.87)
"""Of the arrows, in parts of the curve's length."""


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


_FAINT = 0.35
"""Opacity of the whole walk, behind its last stride."""


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
        trajectory: the motion, with every step saved; for a rigid walker, its heel strikes.
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

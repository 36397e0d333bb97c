"""The paper's figures 9 and 10: leg angle and contact force on several slopes."""

import itertools
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from _force_laws import scene_with
from _force_samples import Motion, largest, motion, strikes
from _options import Options
from matplotlib.axes import Axes

from jaxbiped.plot.style import LEG_COLOURS, LEG_NAMES, LEG_STYLES, dress

SLOPES = (0.010, 0.015, 0.020, 0.025, 0.030, 0.040)
QUICK_SLOPES = (0.020, 0.040)
DURATION = 4.0
BLOCKS = 2400
"""Curves are drawn by the least and the largest value of so many stretches of time."""
TALLEST = 600.0
"""Where the scale of forces ends [N]; a fall's last blow is larger."""


class Descent(NamedTuple):
    """A walk down a slope, and whether it grows as the paper says: a value for each heel strike.

    Angles are the largest of the leg behind, forces the largest on a foot, both until the next
    strike; kinetic energies are those at the strike. All at the sampled times, between which a
    blow in a fall may be larger: it lasts microseconds.
    """

    slope_rad: float
    outcome: str
    end_s: float
    strike_times_s: list[float]
    angles_behind_rad: list[float]
    peaks_N: list[float]  # noqa: N815 (newton)
    kinetic_J: list[float]  # noqa: N815 (joule)
    angle_grows_every_step: bool
    force_grows_every_step: bool
    kinetic_grows_every_step: bool


def descents(options: Options) -> list[Descent]:
    """Walks down every slope and draws both figures."""
    slopes = QUICK_SLOPES if options.quick else SLOPES
    rows = -(-len(slopes) // 2)
    size: dict[str, Any] = dict(figsize=(10.0, 0.9 + 2.0 * rows), layout="constrained")
    angles, angle_axes = plt.subplots(rows, 2, sharex=True, sharey=True, squeeze=False, **size)
    forces, force_axes = plt.subplots(rows, 2, sharex=True, sharey=True, squeeze=False, **size)
    found = []
    for slope, upper, lower in zip(slopes, angle_axes.flat, force_axes.flat, strict=True):
        walked = motion(scene_with({}, slope), DURATION)
        found.append(described(slope, walked))
        title = f"slope {slope:.3f} rad: {walked.outcome}"
        if walked.t[-1] < DURATION * (1.0 - 1e-6):
            title += f" at {walked.t[-1]:.2f} s"
        draw(upper, walked, walked.angle, title)
        draw(lower, walked, walked.normal, title)
        mark_tallest(lower, walked)
    label(angles, angle_axes, r"leg angle, $\theta$ (rad)", "Leg angles on different slopes")
    force_axes[0, 0].set_ylim(0.0, TALLEST)
    label(forces, force_axes, "normal force, $F_N$ (N)", "Contact forces on different slopes")
    options.save(angles, "figure_9_leg_angle.png")
    options.save(forces, "figure_10_contact_force.png")
    return found


def described(slope: float, walked: Motion) -> Descent:
    struck, highest = strikes(walked), largest(walked, walked.normal)
    angles = largest(walked, -walked.angle)
    kinetic = [float(walked.kinetic[strike.place]) for strike in struck]
    return Descent(
        slope_rad=slope,
        outcome=walked.outcome,
        end_s=float(walked.t[-1]),
        strike_times_s=[float(walked.t[strike.place]) for strike in struck],
        angles_behind_rad=angles,
        peaks_N=highest,
        kinetic_J=kinetic,
        angle_grows_every_step=bool(np.all(np.diff(angles) > 0.0)),
        force_grows_every_step=bool(np.all(np.diff(highest) > 0.0)),
        kinetic_grows_every_step=bool(np.all(np.diff(kinetic) > 0.0)),
    )


def draw(ax: Axes, walked: Motion, rows: np.ndarray, title: str) -> None:
    """Both legs' curves, no peak left out."""
    for k, row in enumerate(rows):
        places = telling(row)
        look: dict[str, Any] = dict(color=LEG_COLOURS[k], linestyle=LEG_STYLES[k], linewidth=1.0)
        ax.plot(walked.t[places], row[places], label=LEG_NAMES[k], **look)
    dress(ax, title, "", "")
    ax.set_xlim(0.0, DURATION)


def telling(row: np.ndarray) -> np.ndarray:
    """Places of the least and the largest value in each of `BLOCKS` stretches, in order."""
    edges = np.linspace(0, len(row), BLOCKS + 1).astype(int)
    stretches = [slice(a, b) for a, b in itertools.pairwise(edges) if b > a]
    found = [(s.start + np.argmin(row[s]), s.start + np.argmax(row[s])) for s in stretches]
    return np.unique(np.asarray(found))


def mark_tallest(ax: Axes, walked: Motion) -> None:
    """Says where the force is beyond the scale."""
    if walked.normal.max() > TALLEST:
        when = walked.t[np.argmax(walked.normal.max(axis=0))]
        ax.annotate(
            "beyond the scale",
            (when, 0.9 * TALLEST),
            (6, 0),
            textcoords="offset points",
            fontsize=8,
        )


def label(figure: Any, axes: np.ndarray, y_label: str, title: str) -> None:
    for ax in axes[:, 0]:
        ax.set_ylabel(y_label)
    for ax in axes[-1, :]:
        ax.set_xlabel("time, $t$ (s)")
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper right", ncols=2, frameon=False, fontsize=9)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)

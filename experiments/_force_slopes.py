"""The paper's figures 9 and 10: leg angle and contact force on several slopes."""

import itertools

import numpy as np
from _force_samples import largest, motion, strikes

import jaxbiped as jb
from jaxbiped.plot.style import Look, dress, new_figure

SLOPES, QUICK_SLOPES = (0.010, 0.015, 0.020, 0.025, 0.030, 0.040), (0.020, 0.040)
DURATION = 4.0
BLOCKS = 2400
"""Curves are drawn by the least and the largest value of so many stretches of time."""
TALLEST = 600.0
"""Where the scale of forces ends [N]; a fall's last blow is larger."""


def descents(options):
    """Walks down every slope and draws both figures; returns what was found, and their places."""
    slopes = options.sized(SLOPES, QUICK_SLOPES)
    found = {slope: motion(jb.seed_scene(slope=slope), DURATION) for slope in slopes}
    angles = drawn(
        {slope: (walked, walked.angle) for slope, walked in found.items()},
        r"leg angle, $\theta$ (rad)", "Leg angles on different slopes",
    )  # fmt: skip
    forces = drawn(
        {slope: (walked, walked.normal) for slope, walked in found.items()},
        "normal force, $F_N$ (N)", "Contact forces on different slopes",
    )  # fmt: skip
    for ax, walked in zip(forces.axes, found.values(), strict=False):
        ax.set_ylim(0.0, TALLEST)
        if walked.normal.max() > TALLEST:
            when = walked.t[np.argmax(walked.normal.max(axis=0))]
            look = dict(textcoords="offset points", fontsize=8)
            ax.annotate("beyond the scale", (when, 0.9 * TALLEST), (6, 0), **look)
    pictures = [
        options.save(angles, "figure_9_leg_angle.png"),
        options.save(forces, "figure_10_contact_force.png"),
    ]
    return [described(*each) for each in found.items()], pictures


def described(slope, walked):
    """Whether a walk grows as the paper says: a value for each heel strike.

    Angles are the largest of the leg behind, forces the largest on a foot, both until the next
    strike; kinetic energies are those at the strike. All at the sampled times, between which a blow
    in a fall may be larger: it lasts microseconds.
    """
    places = [place for place, _ in strikes(walked)]
    angles, peaks = largest(walked, -walked.angle), largest(walked, walked.normal)
    kinetic = [float(walked.kinetic[place]) for place in places]
    grows = {
        f"{name}_grows_every_step": bool(np.all(np.diff(values) > 0.0))
        for name, values in (("angle", angles), ("force", peaks), ("kinetic", kinetic))
    }
    return {
        "slope_rad": slope,
        "outcome": walked.outcome,
        "end_s": float(walked.t[-1]),
        "strike_times_s": [float(walked.t[place]) for place in places],
        "angles_behind_rad": angles,
        "peaks_N": peaks,
        "kinetic_J": kinetic,
        **grows,
    }


def drawn(curves, y_label, title):
    """Both legs' curves on each slope, no peak left out."""
    rows = -(-len(curves) // 2)
    figure = new_figure(10.0, 0.9 + 2.0 * rows)
    axes = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
    for ax, (slope, (walked, values)) in zip(axes.flat, curves.items(), strict=True):
        for k, row in enumerate(values):
            places = telling(row)
            look = dict(linewidth=1.0, label=f"leg {k + 1}", **Look(k).line)
            ax.plot(walked.t[places], row[places], **look)
        ended = walked.t[-1] < DURATION * (1.0 - 1e-6)
        when = f" at {walked.t[-1]:.2f} s" if ended else ""
        dress(ax, f"slope {slope:.3f} rad: {walked.outcome}{when}", "", "")
        ax.set_xlim(0.0, DURATION)
    for ax in axes[:, 0]:
        ax.set_ylabel(y_label)
    for ax in axes[-1]:
        ax.set_xlabel("time, $t$ (s)")
    named = axes[0, 0].get_legend_handles_labels()
    figure.legend(*named, loc="outside upper right", ncols=2, frameon=False, fontsize=9)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def telling(row):
    """Places of the least and the largest value in each of `BLOCKS` stretches, in order."""
    edges = np.linspace(0, len(row), BLOCKS + 1).astype(int)
    stretches = [slice(a, b) for a, b in itertools.pairwise(edges) if b > a]
    found = [(s.start + np.argmin(row[s]), s.start + np.argmax(row[s])) for s in stretches]
    return np.unique(np.asarray(found))

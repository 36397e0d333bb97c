"""Pictures of force models: normal and tangential forces, measures and costs."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _force_laws import DURATION, MEASURES, SEED, Findings, deviations
from _force_samples import Stance
from _options import Options
from matplotlib.axes import Axes

from jaxbiped.plot.style import GROUND_COLOUR, dress

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#882255")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)))
EARLIEST = 1e-5
"""Where logarithmic scales of time begin [s]."""
FAMILIES = {
    "Laws with one coefficient": ("coulomb", "threlfall", "ambrosio", "viscous"),
    "Laws with a Stribeck peak": ("smooth-bengisu-akay", "stribeck", "andersson", "brown-mcphee"),
    "Laws with bristles": ("dahl", "lugre"),
}
SINCE = "time after the foot touches, $t$ (s)"
LARGEST = -160.0
"""Where the scale of tangential forces ends [N]."""
LEAST = 1e-7
"""Deviations below this are drawn there."""


def look(place: int, name: str, kind: str) -> dict[str, Any]:
    """Of a law's curve: the seed's own is black and wide, below the others."""
    if name == SEED[kind]:
        return dict(color="black", linewidth=2.6, alpha=0.55, zorder=1, label=f"{name} (seed's)")
    colour, dash = COLOURS[place % len(COLOURS)], DASHES[place % len(DASHES)]
    return dict(color=colour, linestyle=dash, linewidth=1.3, zorder=2, label=name)


def normal_picture(options: Options, stances: dict[str, Stance | None]) -> None:
    """Normal force from touchdown on, and penetration over the step."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.6), layout="constrained")
    for place, (name, each) in enumerate(stances.items()):
        if each is None:
            continue
        style = look(place, name, "normal")
        late = each.t >= EARLIEST
        left.plot(each.t[late], each.normal[late], **style)
        right.plot(each.t, 1e3 * each.depth, **style)
    left.set_xscale("log")
    dress(left, "The first heel strike", SINCE, "normal force, $F_N$ (N)")
    dress(right, "The step that follows", SINCE, r"penetration, $\delta$ (mm)")
    left.set_xlim(left=EARLIEST)
    figure.legend(
        *left.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False
    )
    options.save(figure, "force_models_normal.png")


def friction_picture(options: Options, stances: dict[str, Stance | None]) -> None:
    """Tangential force around the strike and over the step, and slip: a row for each family."""
    families = {
        title: [name for name in names if stances.get(name) is not None]
        for title, names in FAMILIES.items()
    }
    families = {title: names for title, names in families.items() if names}
    size = (12.0, 0.5 + 2.8 * len(families))
    figure, grid = plt.subplots(
        len(families), 3, figsize=size, layout="constrained", squeeze=False, sharex="col"
    )
    for row, (title, names) in zip(grid, families.items(), strict=True):
        for place, name in enumerate([SEED["friction"], *names]):
            each = stances[name]
            assert each is not None
            draw_friction(row, each, look(place, name, "friction"))
        cut_off(row[0], {name: stances[name] for name in names})
        row[0].set_title(title, loc="left", fontsize="medium")
        row[2].legend(frameon=False, fontsize="small", loc="lower left")
    for ax in grid[-1]:
        ax.set_xlabel(SINCE)
    figure.suptitle(
        "The first heel strike and the step that follows, by law of friction", fontsize=11
    )
    options.save(figure, "force_models_friction.png")


def draw_friction(row: Any, each: Stance, style: dict[str, Any]) -> None:
    late = (each.t >= EARLIEST) & (each.normal > 0.0)
    row[0].plot(each.t[late], each.tangential[late], **style)
    row[1].plot(each.t, each.tangential, **style)
    row[2].plot(each.t[late], np.abs(each.slip[late]), **style)
    row[0].set_xscale("log")
    row[1].set_ylim(-8.0, 8.0)
    row[2].set_xscale("log")
    row[2].set_yscale("log")
    row[2].set_ylim(1e-9, 1.0)
    dress(row[0], "", "", "tangential force, $F_T$ (N)")
    dress(row[1], "", "", "tangential force, $F_T$ (N)")
    dress(row[2], "", "", "slip speed, $|V_T|$ (m/s)")


def cut_off(ax: Axes, stances: dict[str, Stance | None]) -> None:
    """Ends the scale of forces where a blow would hide the rest, and says how large it is."""
    for name, each in stances.items():
        if each is not None and each.tangential.min() < LARGEST:
            ax.set_ylim(bottom=LARGEST)
            text = f"{name}: {each.tangential.min():.0f} N".replace("-", "−")
            ax.text(0.98, 0.04, text, transform=ax.transAxes, ha="right", fontsize=9)


TITLES = {"normal": "Laws of the normal force", "friction": "Laws of friction"}
MARKS = {
    "period_s": ("period", "o"),
    "step_length_m": ("step length", "s"),
    "speed_m_s": ("speed", "^"),
    "peak_normal_N": ("peak force", "D"),
    "spectral_radius": ("spectral radius", "v"),
}


def measures_picture(options: Options, found: dict[str, dict[str, Findings]]) -> None:
    """Deviations of every measure from the seed's gait, and what a walk costs."""
    counts = [len(laws) for laws in found.values()]
    figure, grid = plt.subplots(
        2,
        2,
        figsize=(11.0, 2.2 + 0.36 * sum(counts)),
        layout="constrained",
        sharex="col",
        height_ratios=counts,
        width_ratios=[2.0, 1.0],
    )
    for (left, right), (kind, laws) in zip(grid, found.items(), strict=True):
        draw_deviations(left, laws, kind)
        draw_costs(right, laws)
        for ax in (left, right):
            ax.set_ylim(len(laws) - 0.5, -0.5)
            ax.set_yticks(range(len(laws)), list(laws))
        right.tick_params(labelleft=False)
        left.set_title(TITLES[kind], loc="left", fontsize="medium")
    steps = [each.attempted_steps for laws in found.values() for each in laws.values()]
    grid[1, 1].set_xlim(0.5 * min(steps), 20.0 * max(steps))
    grid[1, 0].set_xlabel("deviation from the seed's gait (–); filled: more, open: less")
    grid[1, 1].set_xlabel(f"attempted steps in {DURATION:g} s of walking (–)")
    handles, names = legend_of_marks(grid[0, 0])
    figure.legend(handles, names, loc="outside upper center", ncols=5, frameon=False)
    options.save(figure, "force_models_measures.png")


def draw_deviations(ax: Axes, laws: dict[str, Findings], kind: str) -> None:
    seed = laws[SEED[kind]]
    for place, (name, each) in enumerate(laws.items()):
        if name == SEED[kind]:
            ax.text(2 * LEAST, place, "the seed's law", va="center", fontsize=9)
            continue
        if each.measures is None:
            ax.text(2 * LEAST, place, f"no gait: {each.outcome}", va="center", fontsize=9)
            continue
        for k, (key, value) in enumerate(deviations(each, seed).items()):
            if value is None:
                continue
            face = COLOURS[k] if value > 0.0 else "white"
            where = (max(abs(value), LEAST), place)
            ax.plot(*where, MARKS[key][1], color=COLOURS[k], markerfacecolor=face, markersize=6)
    ax.set_xscale("log")
    ax.set_xlim(0.6 * LEAST, 10.0)
    dress(ax, "", "", "")


def draw_costs(ax: Axes, laws: dict[str, Findings]) -> None:
    for place, each in enumerate(laws.values()):
        walked = each.outcome == "walking"
        face = GROUND_COLOUR if walked else "white"
        ax.plot(each.attempted_steps, place, "o", color=GROUND_COLOUR, markerfacecolor=face)
        text = f"{each.wall_ms:.1f} ms" + ("" if walked else f", ends at {each.end_s:.2f} s")
        where = (each.attempted_steps, place)
        ax.annotate(text, where, (8, 0), textcoords="offset points", va="center", fontsize=8)
    ax.set_xscale("log")
    dress(ax, "", "", "")


def legend_of_marks(ax: Axes) -> tuple[list[Any], list[str]]:
    handles, names = [], []
    for k, key in enumerate(MEASURES):
        (handle,) = ax.plot([], [], MARKS[key][1], color=COLOURS[k])
        handles.append(handle)
        names.append(MARKS[key][0])
    return handles, names

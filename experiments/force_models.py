"""Comparison of force models: the seed's walk under every law of contact.

The paper sets out to compare several models of the normal force and of friction, and shows one of
each. Here each normal law (with the seed's friction) and each law of friction (with the seed's
normal law), matched to the seed's parameters, walks, is timed, searched for its gait and judged:
force_models_normal.png, force_models_friction.png, force_models_measures.png. Its figures 9 and 10,
leg angle and contact force on several slopes: figure_9_leg_angle.png, figure_10_contact_force.png.
"""

import itertools

import numpy as np
from _experiment import Options, experiment
from _force_laws import CRITERIA, DURATION, MEASURES, SEED, deviations, findings, verdict, walk_of
from _scenes import seed_with

import jaxbiped as jb
from jaxbiped.plot.style import (
    COLOURS,
    GROUND_COLOUR,
    LEG_COLOURS,
    LEG_STYLES,
    MARKERS,
    dress,
    new_figure,
)

LAWS = {"normal": tuple(jb.laws.NORMAL_LAWS), "friction": tuple(jb.laws.FRICTION_LAWS)}
QUICK_LAWS = {
    "normal": ("ristow-schafer", "hunt-crossley"),
    "friction": ("bengisu-akay", "coulomb"),
}
REPEATS, QUICK_REPEATS = 15, 3
DRAWN, RTOL = 1.0, 1e-9
"""Time from the seed's start in which one step is drawn [s], and tolerance of what is drawn."""
SLOPES, QUICK_SLOPES = (0.010, 0.015, 0.020, 0.025, 0.030, 0.040), (0.020, 0.040)
DESCENT = 4.0
"""Time on each slope [s]."""
TALLEST, LARGEST = 600.0, -160.0
"""Where scales of normal and of tangential forces end [N]; a fall's last blow is larger."""
DASHES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)))
EARLIEST = 1e-5
"""Where logarithmic scales of time begin [s]."""
FAMILIES = {
    "Laws with one coefficient": ("coulomb", "threlfall", "ambrosio", "viscous"),
    "Laws with a Stribeck peak": ("smooth-bengisu-akay", "stribeck", "andersson", "brown-mcphee"),
    "Laws with bristles": ("dahl", "lugre"),
}
SINCE = "time after the foot touches, $t$ (s)"
LEAST = 1e-7
"""Deviations below this are drawn there."""
TITLES = {"normal": "Laws of the normal force", "friction": "Laws of friction"}
MARKS = dict(zip(MEASURES, MARKERS, strict=False))


@experiment
def main(options: Options):
    repeats = options.sized(REPEATS, QUICK_REPEATS)

    def model(**laws):
        """What is measured of a law, and its first step where it makes one."""
        scene = seed_with(**laws)
        return findings(scene, repeats), first_stance(scene)

    seed, mu_static = model(), float(jb.seed_scene().friction.mu_static)
    models = {
        kind: {name: seed if name == SEED[kind] else model(**{kind: name}) for name in names}
        for kind, names in options.sized(LAWS, QUICK_LAWS).items()
    }
    found, stances = (
        {kind: {name: each[k] for name, each in laws.items()} for kind, laws in models.items()}
        for k in range(2)
    )
    slopes = options.sized(SLOPES, QUICK_SLOPES)
    descents = {slope: descent(jb.seed_scene(slope=slope)) for slope in slopes}
    return {
        "slope_rad": float(jb.seed_scene().ground.slope),
        "criteria": CRITERIA,
        **{
            kind: {
                name: each
                | {
                    "deviations_from_seed": deviations(each, seed[0]),
                    "verdict": verdict(each, seed[0], mu_static),
                }
                for name, each in laws.items()
            }
            for kind, laws in found.items()
        },
        "slopes": [{"slope_rad": slope} | each for slope, (_, each) in descents.items()],
        "pictures": [
            normal_picture(options, stances["normal"]),
            friction_picture(options, stances["friction"]),
            measures_picture(options, found),
            *descent_pictures(options, {slope: rows for slope, (rows, _) in descents.items()}),
        ],
    }


def first_stance(scene):
    """One foot from the first heel strike to the second or to the end, by the time since.

    None without a strike.
    """
    walk, rows = walk_of(scene, DRAWN, rtol=RTOL)
    times, feet = jb.measure.heel_strikes(scene, walk)
    if not len(times):
        return None
    rows = rows.isel(foot=feet[0] - 1).sel(time=slice(*times[:2], None))
    return rows.assign_coords(time=rows.time - times[0])


def descent(scene):
    """A walk down a slope, and whether it grows as the paper says: a value for each heel strike.

    Angles are the largest of the leg behind, forces the largest on a foot, both until the next
    strike; kinetic energies are those at the strike.
    """
    walk, rows = walk_of(scene, DESCENT, rtol=RTOL)
    times = jb.measure.heel_strikes(scene, walk).time_s
    spans = itertools.pairwise([*times, float(walk.t[-1])])
    parts = [rows.sel(time=slice(*span)) for span in spans]
    grown = {
        "angle": [-float(np.minimum(part.theta_1, part.theta_2).min()) for part in parts],
        "force": [float(part.normal_force.max()) for part in parts],
        "kinetic": np.interp(times, rows.time, rows.kinetic_energy).tolist(),
    }
    names = ("angles_behind_rad", "peaks_N", "kinetic_J")
    return rows, {
        "outcome": str(walk.outcome),
        "end_s": float(walk.t[-1]),
        "strike_times_s": times.tolist(),
        **dict(zip(names, grown.values(), strict=True)),
        **{f"{name}_grows_every_step": bool(np.all(np.diff(v) > 0.0)) for name, v in grown.items()},
    }


def descent_pictures(options, walks):
    """The paper's figures 9 and 10."""
    angle, force = r"leg angle, $\theta$ (rad)", "normal force, $F_N$ (N)"
    angles = by_slope(walks, lambda rows: (rows.theta_1, rows.theta_2), angle, "Leg angles")
    forces = by_slope(walks, lambda rows: rows.normal_force, force, "Contact forces")
    forces.axes[0].set_ylim(0.0, TALLEST)
    for ax, rows in zip(forces.axes, walks.values(), strict=False):
        load = rows.normal_force.max("foot")
        if float(load.max()) > TALLEST:
            look = dict(textcoords="offset points", fontsize=8)
            ax.annotate("beyond the scale", (float(load.idxmax()), 0.9 * TALLEST), (6, 0), **look)
    pictures = {"figure_9_leg_angle": angles, "figure_10_contact_force": forces}
    return [options.save(figure, f"{name}.png") for name, figure in pictures.items()]


def by_slope(walks, curves, words, title):
    """Both legs' curves on each slope."""
    rows = -(-len(walks) // 2)
    figure = new_figure(10.0, 0.9 + 2.0 * rows)
    axes = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
    for ax, (slope, walk) in zip(axes.flat, walks.items(), strict=True):
        for k, curve in enumerate(curves(walk)):
            look = dict(color=LEG_COLOURS[k], linestyle=LEG_STYLES[k], linewidth=1.0)
            ax.plot(walk.time, curve, label=f"leg {k + 1}", **look)
        ending = walk.attrs["ending"]
        when = "" if ending == "walking" else f" at {float(walk.time[-1]):.2f} s"
        dress(ax, f"slope {slope:.3f} rad: {ending}{when}", "time, $t$ (s)", words)
        ax.label_outer()
    axes[0, 0].set_xlim(0.0, DESCENT)
    named = axes[0, 0].get_legend_handles_labels()
    figure.legend(*named, loc="outside upper right", ncols=2, frameon=False, fontsize=9)
    figure.suptitle(f"{title} on different slopes", x=0.01, ha="left", fontsize=11)
    return figure


def look(place, name, kind):
    """Of a law's curve: the seed's own is black and wide, below the others."""
    if name == SEED[kind]:
        return dict(color="black", linewidth=2.6, alpha=0.55, zorder=1, label=f"{name} (seed's)")
    colour, dash = COLOURS[place % len(COLOURS)], DASHES[place % len(DASHES)]
    return dict(color=colour, linestyle=dash, linewidth=1.3, zorder=2, label=name)


def normal_picture(options, stances):
    """Normal force from touchdown on, and penetration over the step."""
    left, right = new_figure(10.5, 4.6).subplots(1, 2)
    for place, (name, each) in enumerate(stances.items()):
        if each is None:
            continue
        style, late = look(place, name, "normal"), each.sel(time=slice(EARLIEST, None))
        left.plot(late.time, late.normal_force, **style)
        right.plot(each.time, 1e3 * each.penetration.where(each.touches, 0.0), **style)
    left.set_xscale("log")
    dress(left, "The first heel strike", SINCE, "normal force, $F_N$ (N)")
    dress(right, "The step that follows", SINCE, r"penetration, $\delta$ (mm)")
    left.set_xlim(left=EARLIEST)
    named = left.get_legend_handles_labels()
    left.figure.legend(*named, loc="outside lower center", ncols=4, frameon=False)
    return options.save(left.figure, "force_models_normal.png")


def friction_picture(options, stances):
    """Tangential force around the strike and over the step, and slip: a row for each family."""
    families = {
        title: [name for name in names if stances.get(name) is not None]
        for title, names in FAMILIES.items()
    }
    families = {title: names for title, names in families.items() if names}
    figure = new_figure(12.0, 0.5 + 2.8 * len(families))
    grid = figure.subplots(len(families), 3, squeeze=False, sharex="col")
    for row, (title, names) in zip(grid, families.items(), strict=True):
        for place, name in enumerate([SEED["friction"], *names]):
            draw_friction(row, stances[name], look(place, name, "friction"))
        for name in names:
            cut_off(row[0], name, float(stances[name].tangential_force.min()))
        row[0].set_title(title, loc="left", fontsize="medium")
        row[2].legend(frameon=False, fontsize="small", loc="lower left")
    for ax in grid[-1]:
        ax.set_xlabel(SINCE)
    title = "The first heel strike and the step that follows, by law of friction"
    figure.suptitle(title, fontsize=11)
    return options.save(figure, "force_models_friction.png")


def draw_friction(row, each, style):
    late = each.where(each.normal_force > 0.0).sel(time=slice(EARLIEST, None))
    strike, step, slip = row
    strike.plot(late.time, late.tangential_force, **style)
    step.plot(each.time, each.tangential_force, **style)
    slip.plot(late.time, abs(late.slip_speed), **style)
    strike.set_xscale("log")
    step.set_ylim(-8.0, 8.0)
    slip.set(xscale="log", yscale="log", ylim=(1e-9, 1.0))
    for ax in (strike, step):
        dress(ax, "", "", "tangential force, $F_T$ (N)")
    dress(slip, "", "", "slip speed, $|V_T|$ (m/s)")


def cut_off(ax, name, least):
    """Ends the scale of forces where a blow would hide the rest, and says how large it is."""
    if least < LARGEST:
        ax.set_ylim(bottom=LARGEST)
        text = f"{name}: {least:.0f} N".replace("-", "−")
        ax.text(0.98, 0.04, text, transform=ax.transAxes, ha="right", fontsize=9)


def measures_picture(options, found):
    """Deviations of every measure from the seed's gait, and what a walk costs."""
    counts = [len(laws) for laws in found.values()]
    figure = new_figure(11.0, 2.2 + 0.36 * sum(counts))
    ratios = dict(height_ratios=counts, width_ratios=[2.0, 1.0])
    grid = figure.subplots(2, 2, sharex="col", **ratios)
    for (left, right), (kind, laws) in zip(grid, found.items(), strict=True):
        draw_deviations(left, laws, kind)
        draw_costs(right, laws)
        for ax in (left, right):
            ax.set_xscale("log")
            ax.set_ylim(len(laws) - 0.5, -0.5)
            ax.set_yticks(range(len(laws)), list(laws))
            dress(ax, "", "", "")
        right.tick_params(labelleft=False)
        left.set_title(TITLES[kind], loc="left", fontsize="medium")
    steps = [each["attempted_steps"] for laws in found.values() for each in laws.values()]
    grid[1, 1].set_xlim(0.5 * min(steps), 20.0 * max(steps))
    grid[1, 0].set_xlabel("deviation from the seed's gait (–); filled: more, open: less")
    grid[1, 1].set_xlabel(f"attempted steps in {DURATION:g} s of walking (–)")
    handles = [
        grid[0, 0].plot([], [], mark, color=colour)[0]
        for mark, colour in zip(MARKS.values(), COLOURS, strict=False)
    ]
    names = ["period", "step length", "speed", "peak force", "spectral radius"]
    figure.legend(handles, names, loc="outside upper center", ncols=5, frameon=False)
    return options.save(figure, "force_models_measures.png")


def draw_deviations(ax, laws, kind):
    for place, (name, each) in enumerate(laws.items()):
        own = name == SEED[kind]
        if own or each["measures"] is None:
            said = "the seed's law" if own else f"no gait: {each['outcome']}"
            ax.text(2 * LEAST, place, said, va="center", fontsize=9)
            continue
        off = deviations(each, laws[SEED[kind]])
        for colour, (key, value) in zip(COLOURS, off.items(), strict=False):
            if value is not None:
                style = dict(color=colour, markerfacecolor=colour if value > 0.0 else "white")
                ax.plot(max(abs(value), LEAST), place, MARKS[key], markersize=6, **style)
    ax.set_xlim(0.6 * LEAST, 10.0)


def draw_costs(ax, laws):
    for place, each in enumerate(laws.values()):
        walked, where = each["outcome"] == "walking", (each["attempted_steps"], place)
        face = GROUND_COLOUR if walked else "white"
        ax.plot(*where, "o", color=GROUND_COLOUR, markerfacecolor=face)
        text = f"{each['wall_ms']:.1f} ms" + ("" if walked else f", ends at {each['end_s']:.2f} s")
        style = dict(textcoords="offset points", va="center", fontsize=8)
        ax.annotate(text, where, (8, 0), **style)


if __name__ == "__main__":
    main()

"""Comparison of force models: the seed's walk under every law of contact.

The paper sets out to compare several models of the normal force and of friction, and shows one of
each. Here each normal law (with the seed's friction) and each law of friction (with the seed's
normal law), matched to the seed's parameters, walks, is timed, searched for its gait and judged:
force_models_normal.png, force_models_friction.png, force_models_measures.png. Its figures 9 and 10,
leg angle and contact force on several slopes: figure_9_leg_angle.png, figure_10_contact_force.png.
"""

import numpy as np
from _experiment import Options, experiment
from _force_laws import CRITERIA, DURATION, MEASURES, SEED, deviations, findings, verdict
from _force_samples import first_stance, motion
from _force_slopes import descents
from _pictures import COLOURS, MARKERS
from _scenes import seed_with

import jaxbiped as jb
from jaxbiped.plot.style import GROUND_COLOUR, dress, new_figure

LAWS = {"normal": tuple(jb.laws.NORMAL_LAWS), "friction": tuple(jb.laws.FRICTION_LAWS)}
QUICK_LAWS = {
    "normal": ("ristow-schafer", "hunt-crossley"),
    "friction": ("bengisu-akay", "coulomb"),
}
REPEATS, QUICK_REPEATS = 15, 3
DRAWN = 1.0
"""Time from the seed's start in which one step is drawn [s]."""
DASHES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)))
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
TITLES = {"normal": "Laws of the normal force", "friction": "Laws of friction"}
MARKS = dict(zip(MEASURES, MARKERS, strict=False))


@experiment
def main(options: Options):
    repeats = options.sized(REPEATS, QUICK_REPEATS)

    def model(**laws):
        """What is measured of a law, and its first step where it makes one."""
        scene = seed_with(**laws)
        return findings(scene, repeats), first_stance(motion(scene, DRAWN))

    seed, mu_static = model(), float(jb.seed_scene().friction.mu_static)
    models = {
        kind: {name: seed if name == SEED[kind] else model(**{kind: name}) for name in names}
        for kind, names in options.sized(LAWS, QUICK_LAWS).items()
    }
    found, stances = (
        {kind: {name: each[k] for name, each in laws.items()} for kind, laws in models.items()}
        for k in range(2)
    )
    slopes, figures = descents(options)
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
        "slopes": slopes,
        "pictures": [
            normal_picture(options, stances["normal"]),
            friction_picture(options, stances["friction"]),
            measures_picture(options, found),
            *figures,
        ],
    }


def look(place, name, kind):
    """Of a law's curve: the seed's own is black and wide, below the others."""
    if name == SEED[kind]:
        return dict(color="black", linewidth=2.6, alpha=0.55, zorder=1, label=f"{name} (seed's)")
    colour, dash = COLOURS[place % len(COLOURS)], DASHES[place % len(DASHES)]
    return dict(color=colour, linestyle=dash, linewidth=1.3, zorder=2, label=name)


def normal_picture(options, stances):
    """Normal force from touchdown on, and penetration over the step."""
    figure = new_figure(10.5, 4.6)
    left, right = figure.subplots(1, 2)
    for place, (name, each) in enumerate(stances.items()):
        if each is None:
            continue
        style, late = look(place, name, "normal"), each.t >= EARLIEST
        left.plot(each.t[late], each.normal[late], **style)
        right.plot(each.t, 1e3 * each.depth, **style)
    left.set_xscale("log")
    dress(left, "The first heel strike", SINCE, "normal force, $F_N$ (N)")
    dress(right, "The step that follows", SINCE, r"penetration, $\delta$ (mm)")
    left.set_xlim(left=EARLIEST)
    named = left.get_legend_handles_labels()
    figure.legend(*named, loc="outside lower center", ncols=4, frameon=False)
    return options.save(figure, "force_models_normal.png")


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
            cut_off(row[0], name, stances[name].tangential.min())
        row[0].set_title(title, loc="left", fontsize="medium")
        row[2].legend(frameon=False, fontsize="small", loc="lower left")
    for ax in grid[-1]:
        ax.set_xlabel(SINCE)
    title = "The first heel strike and the step that follows, by law of friction"
    figure.suptitle(title, fontsize=11)
    return options.save(figure, "force_models_friction.png")


def draw_friction(row, each, style):
    late = (each.t >= EARLIEST) & (each.normal > 0.0)
    strike, step, slip = row
    strike.plot(each.t[late], each.tangential[late], **style)
    step.plot(each.t, each.tangential, **style)
    slip.plot(each.t[late], np.abs(each.slip[late]), **style)
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

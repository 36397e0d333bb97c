"""Truth of gradients through contact: a ball on a stiff spring, and a footstep of the walker.

Writes gradient_truth.png and footstep_truth.png. Every tool that is installed differentiates the
ball's state after three bounces with respect to its height, gravity, stiffness and damping; errors
are against the closed form, which the numbers hold, too, so that other tools can be measured
against it. Then time and end of one footstep are differentiated with respect to its start,
stiffness, damping and friction.
"""

import dataclasses

from _ball_closed_form import PROBLEMS, closed_form
from _ball_peers import PEERS
from _ball_ways import OUR_WAYS
from _experiment import Options, by, experiment, label
from _footstep_ways import INPUTS, OUTPUTS, WAYS, references
from _gradient_ways import NOT_INSTALLED, OTHER_LAW, draw_way, row_of, versions
from reference.footstep import LAWS, MID_STANCE, PARAMETERS, footstep
from tqdm import tqdm

from jaxbiped.plot.style import legend, new_figure

REPEATS = 3


@experiment
def main(options: Options):
    work = [(problem, way) for problem in PROBLEMS for way in (*OUR_WAYS, *PEERS)]
    rows = [row for pair in tqdm(work, desc="ball") for row in ball_rows(options, *pair)]
    walked = of_footstep(options)
    return {
        "problems": [problem_and_truth(problem) for problem in PROBLEMS],
        "rows": rows,
        "footstep": walked,
        "versions": versions(),
        "pictures": [draw_ball(options, rows), draw_footstep(options, walked["rows"])],
    }


def problem_and_truth(problem):
    """A problem and its truth, in SI units; derivatives are with respect to logarithms."""
    told = dataclasses.asdict(problem) | {"parameters": list(problem.parameters)}
    return told | dataclasses.asdict(closed_form(problem))


def ball_rows(options, problem, way):
    """Errors of one way at each of its settings, or why there are none."""
    law = way.law(problem)
    if law is None or not way.installed:
        named = {"problem": problem.name, "way": way.name, "setting": way.setting}
        return [named | {"outcome": OTHER_LAW if way.installed else NOT_INSTALLED}]
    truth, how = closed_form(law), dict(repeats=options.sized(REPEATS, 1), least=0.0)
    settings = options.sized(way.settings, way.settings[:2])
    return [row_of(problem.name, way, value, problem, truth, **how) for value in settings]


def of_footstep(options):
    """The footstep and its truth, and errors of each way at each of its settings."""
    truth, change, apart = references()
    ways = options.sized(WAYS, (WAYS[0], WAYS[-1]._replace(settings=(1e-4,))))
    work = [(way, value) for way in ways for value in way.settings]
    rows = [
        row_of("footstep", way, value, truth, truth, repeats=1, least=1e-2)
        for way, value in tqdm(work, desc="footstep")
    ]
    problem = {
        "start": MID_STANCE.tolist(),
        "parameters": dict(zip(PARAMETERS, LAWS.tolist(), strict=True)),
        "outputs": list(OUTPUTS),
        "inputs": list(INPUTS),
        "values": truth.state.tolist(),
        "gradient": truth.gradient.tolist(),
        "switches": [list(each) for each in footstep().switches],
        "coarser_collocation": change,
        "our_finest": apart,
    }
    return {"problem": problem, "rows": rows}


def draw_ways(ax, rows, names, words):
    """Errors of gradients over those of states, and what ways say of them."""
    for k, name in enumerate(names):
        own = [row for row in rows if (row["way"], row["outcome"]) == (name, "answered")]
        # The two semi-implicit steps are the same: rings about dots.
        ring = dict(markersize=10.0, markerfacecolor="none") if name == "Warp" else {}
        if own:
            draw_way(ax, name, own, color=f"C{k}", **ring)
    ax.axhline(1.0, color="black", linewidth=0.8)
    label(ax, f"error of the {words} (relative)", "error of its gradient (relative)")


def draw_ball(options, rows):
    """A panel a problem."""
    figure, named = new_figure(10.0, 4.6), {}
    for ax, problem in zip(figure.subplots(1, 2, sharey=True), PROBLEMS, strict=True):
        own = [row for row in rows if row["problem"] == problem.name]
        draw_ways(ax, own, by("way", rows), "state")
        ax.text(0.02, 1.3, "as wrong as no gradient at all", transform=ax.get_yaxis_transform())
        ax.set_title(f"three bounces on a {problem.name}")
        ax.label_outer()
        named |= dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
    figure.legend(list(named.values()), list(named), loc="outside lower center", ncols=3)
    return options.save(figure, "gradient_truth.png")


def draw_footstep(options, rows):
    ax = new_figure(6.5, 5.4).subplots()
    draw_ways(ax, rows, by("way", rows), "footstep")
    legend(ax, loc="lower right")
    return options.save(ax.figure, "footstep_truth.png")


if __name__ == "__main__":
    main()

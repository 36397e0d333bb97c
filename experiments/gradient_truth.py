"""Truth of gradients through contact: a ball on a stiff spring, whose derivatives are known.

Writes gradient_truth.png. Every tool that is installed differentiates the ball's state after three
bounces with respect to its height, gravity, stiffness and damping; errors are against the closed
form, which the numbers hold, too, so that other tools can be measured against it.
"""

import dataclasses

from _ball_closed_form import PROBLEMS, closed_form
from _ball_peers import PEERS
from _ball_ways import OUR_WAYS
from _experiment import Options, by, experiment
from _gradient_ways import NOT_INSTALLED, OTHER_LAW, draw_way, row_of, versions
from tqdm import tqdm

from jaxbiped.plot.style import new_figure

REPEATS = 3


@experiment
def main(options: Options):
    work = [(problem, way) for problem in PROBLEMS for way in (*OUR_WAYS, *PEERS)]
    rows = [row for pair in tqdm(work, desc="ways") for row in _rows(options, *pair)]
    problems = [_problem(problem) for problem in PROBLEMS]
    picture = _draw(options, [row for row in rows if row["outcome"] == "answered"])
    return {"problems": problems, "rows": rows, "versions": versions(), "picture": picture}


def _problem(problem):
    """A problem and its truth, in SI units; derivatives are with respect to logarithms."""
    return {
        **dataclasses.asdict(problem),
        "parameters": list(problem.parameters),
        **dataclasses.asdict(closed_form(problem)),
    }


def _rows(options, problem, way):
    """Errors of one way at each of its settings, or why there are none."""
    law = way.law(problem)
    if law is None or not way.installed:
        named = {"problem": problem.name, "way": way.name, "setting": way.setting}
        return [named | {"outcome": OTHER_LAW if way.installed else NOT_INSTALLED}]
    truth, how = closed_form(law), dict(repeats=options.sized(REPEATS, 1), least=0.0)
    settings = options.sized(way.settings, way.settings[:2])
    return [row_of(problem.name, way, value, problem, truth, **how) for value in settings]


def _draw(options, answered):
    """Error of the gradient over that of the state, a panel a problem."""
    figure = new_figure(10.0, 4.6)
    panels = figure.subplots(1, len(PROBLEMS), sharey=True)
    colours = {name: f"C{k}" for k, name in enumerate(by("way", answered))}
    named = {}
    for ax, problem in zip(panels, PROBLEMS, strict=True):
        own = [row for row in answered if row["problem"] == problem.name]
        for name, points in by("way", own).items():
            # The two semi-implicit steps are the same: rings about dots.
            ring = dict(markersize=10.0, markerfacecolor="none") if name == "Warp" else {}
            draw_way(ax, name, points, color=colours[name], **ring)
        ax.axhline(1.0, color="black", linewidth=0.8)
        ax.text(0.02, 1.3, "as wrong as no gradient at all", transform=ax.get_yaxis_transform())
        ax.set_title(f"three bounces on a {problem.name}")
        ax.set_xlabel("relative error of the state [1]")
        named |= dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
    panels[0].set_ylabel("relative error of the gradient [1]")
    figure.legend(list(named.values()), list(named), loc="outside lower center", ncols=3)
    return options.save(figure, "gradient_truth.png")


if __name__ == "__main__":
    main()

"""Truth of gradients through contact: a ball on a stiff spring, whose derivatives are known.

Writes gradient_truth.png. Every tool that is installed differentiates the ball's state after three
bounces with respect to its height, gravity, stiffness and damping; errors are against the closed
form, which the numbers hold, too, so that other tools can be measured against it.
"""

import dataclasses
from typing import Any

import matplotlib.pyplot as plt
from _ball_closed_form import PROBLEMS, Problem, closed_form
from _ball_peers import PEERS
from _ball_ways import OUR_WAYS
from _gradient_ways import NOT_INSTALLED, OTHER_LAW, Way, draw_way, row_of
from _options import Options, parse
from _truth_table import say_rows, versions
from tqdm import tqdm

REPEATS = 3


def main() -> None:
    options = parse(__doc__ or "")
    numbers = measured(options)
    say_rows(options, numbers["rows"])
    options.finish(numbers)


def measured(options: Options) -> dict[str, Any]:
    """The problems with their truths, and the rows of all ways; draws them."""
    problems = [_problem(problem) for problem in PROBLEMS]
    ways = (*OUR_WAYS, *PEERS)
    work = [(problem, way) for problem in PROBLEMS for way in ways]
    rows: list[dict[str, Any]] = []
    for problem, way in tqdm(work, desc="ways"):
        rows += _rows(problem, way, quick=options.quick)
    picture = _draw(options, rows)
    return {"problems": problems, "rows": rows, "versions": versions(), "picture": picture}


def _problem(problem: Problem) -> dict[str, Any]:
    """A problem and its truth, in SI units; derivatives are with respect to logarithms."""
    truth = closed_form(problem)
    return {
        **dataclasses.asdict(problem),
        "parameters": list(problem.parameters),
        "bounces": truth.bounces,
        "state": list(truth.state),
        "gradient": [list(row) for row in truth.gradient],
        "uncertainty": truth.uncertainty,
    }


def _rows(problem: Problem, way: Way, *, quick: bool) -> list[dict[str, Any]]:
    """Errors of one way at each of its settings, or why there are none."""
    named: dict[str, Any] = {"problem": problem.name, "way": way.name, "setting": way.setting}
    if not way.installed:
        return [named | {"outcome": NOT_INSTALLED}]
    law = way.law(problem)
    if law is None:
        return [named | {"outcome": OTHER_LAW}]
    truth, repeats = closed_form(law), 1 if quick else REPEATS
    return [
        row_of(problem.name, way, value, problem, truth, repeats=repeats, least=0.0)
        for value in way.settings[: 2 if quick else None]
    ]


def _draw(options: Options, rows: list[dict[str, Any]]) -> str:
    """Error of the gradient over that of the state, a panel a problem."""
    answered = [row for row in rows if row["outcome"] == "answered"]
    figure, panels = plt.subplots(
        1, len(PROBLEMS), figsize=(10.0, 4.6), sharey=True, layout="constrained"
    )
    for ax, problem in zip(panels, PROBLEMS, strict=True):
        own = [row for row in answered if row["problem"] == problem.name]
        for colour, name in enumerate(dict.fromkeys(row["way"] for row in answered)):
            points = [row for row in own if row["way"] == name]
            if not points:
                continue
            # The two semi-implicit steps are the same: rings about dots.
            ring = dict(markersize=10.0, markerfacecolor="none") if name == "Warp" else {}
            draw_way(ax, name, points, color=f"C{colour}", **ring)
        ax.axhline(1.0, color="black", linewidth=0.8)
        ax.text(0.02, 1.3, "as wrong as no gradient at all", transform=ax.get_yaxis_transform())
        ax.set_title(f"three bounces on a {problem.name}")
        ax.set_xlabel("relative error of the state [1]")
    panels[0].set_ylabel("relative error of the gradient [1]")
    figure.legend(*_labels(panels), loc="outside lower center", ncols=3)
    return options.save(figure, "gradient_truth.png")


def _labels(panels: Any) -> tuple[list[Any], list[str]]:
    named: dict[str, Any] = {}
    for ax in panels:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    return list(named.values()), list(named)


if __name__ == "__main__":
    main()

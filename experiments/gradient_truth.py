"""Truth of gradients through contact: a ball on a stiff spring, whose derivatives are known.

Writes gradient_truth.png. Every tool that is installed differentiates the ball's state after three
bounces with respect to its height, gravity, stiffness and damping; errors are against the closed
form, which the numbers hold, too, so that other tools can be measured against it.
"""

import dataclasses
import importlib.util
import time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _ball_closed_form import PROBLEMS, Problem, closed_form
from _ball_peers import PEERS
from _ball_ways import OUR_WAYS, Run, Way, relative_error
from _options import Options, parse
from _truth_table import say_rows, versions
from tqdm import tqdm

NOT_INSTALLED, OTHER_LAW = "not installed", "its contact has another law"
REPEATS, ENOUGH = 3, 3.0
"""Runs that took so long together [s] are not repeated again."""


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
    picture = str(_draw(options, rows))
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
    if way.module and importlib.util.find_spec(way.module) is None:
        return [named | {"outcome": NOT_INSTALLED}]
    law = way.law(problem)
    if law is None:
        return [named | {"outcome": OTHER_LAW}]
    truth = closed_form(law)
    found = []
    for value in way.settings[: 2 if quick else None]:
        run = way.prepare(problem, value)
        answer = run()
        state = np.abs(np.asarray(answer.state) - truth.state) / np.abs(truth.state)
        found.append(
            named
            | {
                "outcome": "answered",
                "value": value,
                "state_error": float(np.max(state)),
                "gradient_error": relative_error(answer.gradient, truth.gradient),
                "said": answer.said,
            }
            | _work(run, 1 if quick else REPEATS)
        )
    return found


def _work(run: Run, repeats: int) -> dict[str, float]:
    """Median times of state and gradient, compiled before: by the clock, and of all threads."""
    spans: list[tuple[float, float]] = []
    while not spans or (len(spans) < repeats and sum(wall for wall, _ in spans) < ENOUGH):
        began, before = time.perf_counter(), time.process_time()
        run()
        spans.append((time.perf_counter() - began, time.process_time() - before))
    seconds, cpu = (float(np.median([span[k] for span in spans])) for k in range(2))
    return {"seconds": seconds, "cpu_s": cpu}


def _draw(options: Options, rows: list[dict[str, Any]]) -> Any:
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
            errors = [[row[key] for row in points] for key in ("state_error", "gradient_error")]
            # The two semi-implicit steps are the same: rings about dots.
            ring = dict(markersize=10.0, markerfacecolor="none") if name == "Warp" else {}
            (line,) = ax.loglog(*errors, "o-", color=f"C{colour}", label=name, **ring)
            if points[0]["said"] is not None:
                said = [row["said"] for row in points]
                ax.loglog(
                    errors[0], said, "v:", color=line.get_color(), label=f"{name}: what it says"
                )
        ax.axhline(1.0, color="black", linewidth=0.8)
        ax.text(0.02, 1.3, "as wrong as no gradient at all", transform=ax.get_yaxis_transform())
        ax.set_title(f"three bounces on a {problem.name}")
        ax.set_xlabel("relative error of the state [1]")
    panels[0].set_ylabel("relative error of the gradient [1]")
    figure.legend(*_labels(panels), loc="outside lower center", ncols=3)
    path = options.path("gradient_truth.png")
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return path


def _labels(panels: Any) -> tuple[list[Any], list[str]]:
    named: dict[str, Any] = {}
    for ax in panels:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    return list(named.values()), list(named)


if __name__ == "__main__":
    main()

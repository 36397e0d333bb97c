"""Truth of a footstep's gradients: the walker's own, beside that of the ball.

Writes footstep_truth.png. Ours differentiates the time and the end of one footstep with respect to
its start, stiffness, damping and friction. The truth is by collocation on one smooth piece of the
laws at a time (`_footstep_collocation.py`), which shares nothing with ours. Beside it are plain
diffrax, equal steps, CasADi's CVODES where it is installed, and differences of SciPy's solves.
"""

import importlib.util
import time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _ball_ways import Answer, relative_error
from _footstep_collocation import footstep
from _footstep_equations import LAWS, PARAMETERS, START
from _footstep_peers import PEERS, Peer
from _footstep_ways import INPUTS, OUTPUTS, ours, references
from _options import Options, parse
from _truth_table import say_rows, versions
from tqdm import tqdm

OURS = Peer("jaxbiped", "rtol", (1e-4, 3e-7, 1e-9), ours)
NOT_INSTALLED, OVERFLOWED = "not installed", "derivatives overflow"


def main() -> None:
    options = parse(__doc__ or "")
    numbers = measured(options)
    say_rows(options, numbers["rows"])
    options.finish(numbers)


def measured(options: Options) -> dict[str, Any]:
    """The problem with its truth, and the rows of all ways; draws them."""
    truth, change, apart = references()
    ways = (OURS, PEERS[-1]._replace(settings=(1e-4,))) if options.quick else (OURS, *PEERS)
    work = [(way, value) for way in ways for value in way.settings]
    rows = [_row(way, value, truth) for way, value in tqdm(work, desc="ways")]
    problem = {
        "start": START.tolist(),
        "parameters": dict(zip(PARAMETERS, LAWS.tolist(), strict=True)),
        "outputs": list(OUTPUTS),
        "inputs": list(INPUTS),
        "values": truth.state.tolist(),
        "gradient": truth.gradient.tolist(),
        "switches": [list(each) for each in footstep().switches],
        "coarser_collocation": change,
        "our_finest": apart,
    }
    options.say(f"coarser collocation changes it by {change:.1e}; our finest solve by {apart:.1e}")
    picture = str(_draw(options, rows))
    return {"problem": problem, "rows": rows, "versions": versions(), "picture": picture}


def _row(way: Peer, value: float, truth: Answer) -> dict[str, Any]:
    """Errors of one way at one setting, and its time once compiled; or why there are none."""
    named = {"problem": "footstep", "way": way.name, "setting": way.setting, "value": value}
    if way.module and importlib.util.find_spec(way.module) is None:
        return named | {"outcome": NOT_INSTALLED}
    try:
        run = way.prepare(truth, value)
        answer = run()
        began, before = time.perf_counter(), time.process_time()
        run()
    except RuntimeError as error:
        return named | {"outcome": f"raised {type(error).__name__}"}
    spent = {"seconds": time.perf_counter() - began, "cpu_s": time.process_time() - before}
    scale = np.maximum(np.abs(truth.state), 1e-2)
    off = float(np.max(np.abs(answer.state - truth.state) / scale))
    if not np.all(np.isfinite(answer.gradient)):
        return named | {"outcome": OVERFLOWED, "state_error": off} | spent
    return (
        named
        | {
            "outcome": "answered",
            "state_error": off,
            "gradient_error": relative_error(answer.gradient, truth.gradient),
            "said": answer.said,
        }
        | spent
    )


def _draw(options: Options, rows: list[dict[str, Any]]) -> Any:
    rows = [row for row in rows if row["outcome"] == "answered"]
    figure, ax = plt.subplots(figsize=(6.5, 5.4), layout="constrained")
    for name in dict.fromkeys(row["way"] for row in rows):
        own = [row for row in rows if row["way"] == name]
        errors = [[row[key] for row in own] for key in ("state_error", "gradient_error")]
        (line,) = ax.loglog(*errors, "o-", label=name)
        if own[0]["said"] is not None:
            said = [row["said"] for row in own]
            ax.loglog(errors[0], said, "v:", color=line.get_color(), label=f"{name}: what it says")
    ax.axhline(1.0, color="black", linewidth=0.8)
    ax.set_xlabel("relative error of the footstep [1]")
    ax.set_ylabel("relative error of its gradient [1]")
    ax.legend(fontsize="small")
    path = options.path("footstep_truth.png")
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return path


if __name__ == "__main__":
    main()

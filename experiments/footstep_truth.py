"""Truth of a footstep's gradients: the walker's own, beside that of the ball.

Writes footstep_truth.png. Ours differentiates the time and the end of one footstep with respect to
its start, stiffness, damping and friction. The truth is by collocation on one smooth piece of the
laws at a time (`_footstep_collocation.py`), which shares nothing with ours. Beside it are
differences of SciPy's solves.
"""

import time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _ball_ways import Answer, relative_error
from _footstep_collocation import footstep
from _footstep_equations import LAWS, PARAMETERS, START
from _footstep_peers import PEERS
from _footstep_ways import INPUTS, OUTPUTS, ours, references
from _options import Options, parse
from tqdm import tqdm

OURS = ("jaxbiped", "rtol", (1e-4, 3e-7, 1e-9), ours)
"""Name, what is varied, its values from rough to fine, and the way."""


def main() -> None:
    options = parse(__doc__ or "")
    truth, change, apart = references()
    work = [(OURS, value) for value in OURS[2]]
    if options.quick:
        work.append((PEERS[-1], PEERS[-1][2][0]))
    else:
        work += [(way, value) for way in PEERS for value in way[2]]
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
    for row in rows:
        said = "nothing" if row["said"] is None else f"{row['said']:.1e}"
        options.say(
            f"{row['way']:28s}{row['setting']} {row['value']:<8.0e}{row['state_error']:>9.1e}"
            f"{row['gradient_error']:>10.1e}  {row['seconds']:8.3f} s  says {said}"
        )
    options.finish({"problem": problem, "rows": rows, "picture": str(_draw(options, rows))})


def _row(way: tuple[Any, ...], value: float, truth: Answer) -> dict[str, Any]:
    """Errors of one way at one setting, and its time once compiled."""
    name, setting, _, prepare = way
    run = prepare(truth, value)
    answer = run()
    began = time.perf_counter()
    run()
    seconds = time.perf_counter() - began
    scale = np.maximum(np.abs(truth.state), 1e-2)
    return {
        "way": name,
        "setting": setting,
        "value": value,
        "state_error": float(np.max(np.abs(answer.state - truth.state) / scale)),
        "gradient_error": relative_error(answer.gradient, truth.gradient),
        "said": answer.said,
        "seconds": seconds,
    }


def _draw(options: Options, rows: list[dict[str, Any]]) -> Any:
    figure, ax = plt.subplots(figsize=(5.5, 4.6), layout="constrained")
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
    ax.legend()
    path = options.path("footstep_truth.png")
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return path


if __name__ == "__main__":
    main()

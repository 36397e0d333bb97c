"""Every capability on eight mechanisms: in each cell a number, or the sentence that refuses it.

Writes mechanism_matrix.md, the table of docs/testing.md, and mechanism_matrix.png, the walkers.
Cells are kept in mechanism_matrix.jsonl: a run that was cut off goes on. `--quick` tries a few
capabilities on two of the mechanisms.
"""

import dataclasses
import math
import time

from _experiment import Options, experiment
from _mechanism_cells import CAPABILITIES, Trial
from _mechanisms import Case, cases
from _quote_words import table

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

QUICK_CASES = ("torso on a spring", "kneed")
QUICK = ("walk", "energy ledger", "gait", "operations")


@dataclasses.dataclass(frozen=True)
class MatrixOptions(Options):
    """Options of the matrix."""

    only: tuple[str, ...] = ()
    """Mechanisms to try, by name; all unless given."""
    capabilities: tuple[str, ...] = ()
    """What to try on them, by name; all unless given."""


@experiment
def main(options: MatrixOptions):
    chosen = {
        name: case
        for name, case in cases().items()
        if name in (options.only or options.sized(tuple(cases()), QUICK_CASES))
    }
    wanted = options.capabilities or options.sized(tuple(CAPABILITIES), QUICK)
    store = options.store("mechanism_matrix")
    trials = {
        name: Trial(name, case, options.path(name.replace(" ", "_")))
        for name, case in chosen.items()
    }
    rows = [
        {
            "capability": each,
            "number": CAPABILITIES[each].meaning,
            "cells": {
                name: store.row(f"{name}, {each}", cell, each, name, trial)
                for name, trial in trials.items()
            },
        }
        for each in CAPABILITIES
        if each in wanted
    ]
    options.path("mechanism_matrix.md").write_text("\n".join(table(rows)) + "\n")
    return {"rows": rows, "picture": draw(options, chosen)}


def cell(capability: str, mechanism: str, trial: Trial) -> float | int | str:
    """A number, or the sentence that refuses it."""
    began = time.perf_counter()
    try:
        number = CAPABILITIES[capability].measured(trial)
    except (jb.ArgumentError, LookupError) as refusal:
        return str(refusal)
    except Exception as error:
        return f"{type(error).__name__}: {error}".splitlines()[0]
    finally:
        print(f"{mechanism}, {capability}: {time.perf_counter() - began:.0f} s", flush=True)
    return number if math.isfinite(number) else "not a finite number."


def draw(options: MatrixOptions, chosen: dict[str, Case]) -> str:
    """Two footsteps of each walker."""
    rows = math.ceil(len(chosen) / 2)
    figure = new_figure(11.0, 3.2 * rows)
    panels = figure.subplots(rows, 2, squeeze=False).flat
    for axes, (name, case) in zip(panels, chosen.items(), strict=False):
        walk = jb.simulate(case.scene, case.guess, footsteps=2)
        jb.plot.gait_strobe(case.scene, walk, ax=axes, stop=float(walk.t[-1]), count=6)
        axes.set_title(name, loc="left")
    return options.save(figure, "mechanism_matrix.png")


if __name__ == "__main__":
    main()

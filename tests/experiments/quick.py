"""Experiments at their quick size, and the figures that they draw.

Those of one subject are tested in one file, which is what workers share. Most run in the tests' own
process, which has the libraries imported and the programs compiled already. Those that settle cores
or XLA's flags before JAX is imported run `alone`, in a process of their own.
"""

import contextlib
import importlib.util
import io
import json
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from matplotlib.figure import Figure

from tests.drawn import assert_is_drawn, saved_figures

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "experiments"


class Run(NamedTuple):
    """What an experiment left: its numbers, and its figures by the names of their files."""

    numbers: dict[str, Any]
    figures: dict[str, Figure]


def drawn_run(name, folder, *, unitless=(), alone=False):
    """A quick run, each of whose figures is drawn with its units; `unitless` as there."""
    run = quick_run(name, folder, alone=alone)
    assert run.figures
    for figure in run.figures.values():
        assert_is_drawn(figure, unitless=unitless)
    return run


def quick_run(name, folder, *, alone=False):
    """Runs an experiment at its quick size, with all it writes in `folder`."""
    if not alone:
        return _run_here(name, folder)
    kept = folder / "figures.pickle"
    command = [sys.executable, "-m", "tests.experiments.quick", name, str(folder), str(kept)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return Run(_numbers(folder), pickle.loads(kept.read_bytes()))


def _numbers(folder):
    return json.loads((folder / "numbers.json").read_text())


def _run_here(name, folder):
    words = [name, "--quick", "--out", str(folder), "--json", str(folder / "numbers.json")]
    silent = contextlib.redirect_stdout(io.StringIO())
    with pytest.MonkeyPatch.context() as patch, silent, saved_figures() as figures:
        patch.setattr(sys, "argv", words)
        patch.syspath_prepend(str(FOLDER))
        place = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
        module = importlib.util.module_from_spec(place)
        place.loader.exec_module(module)
        module.main()
    for picture in figures:
        assert (folder / picture).is_file(), picture
    return Run(_numbers(folder), figures)


if __name__ == "__main__":
    chosen, out, pickled = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    pickled.write_bytes(pickle.dumps(_run_here(chosen, out).figures))

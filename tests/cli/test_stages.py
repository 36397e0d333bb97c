"""What takes long in a command, against the word that names it."""

import contextlib
import functools
import importlib

import pytest

import jaxbiped as jb
from jaxbiped._progress import Stage
from jaxbiped.cli import main

WALK = "walk --duration 0.05"


class _ReachedError(Exception):
    """The slow part began."""


@pytest.mark.parametrize(
    ("arguments", "module", "slow", "word"),
    [
        (WALK, "_walk", "Simulation.prepare", "start"),
        (WALK, "_walk", "Simulation.compile", "compiling"),
        (WALK, "_walk_report", "footsteps", "footsteps"),
        (f"{WALK} --out OUT", "_walk", "cli._walk_report.write_outputs", "figures"),
        (f"{WALK} --formulation redundant", "_walk", "Simulation.prepare", "start"),
        (f"{WALK} --model rigid", "_walk", "rigid_walk", "compiling"),
        ("basin", "_basin", "labelling", "gaits"),
        ("models", "_models", "measure.operation_counts", "counting"),
        ("constraints", "_constraints", "cli._constraints.final_truth", "minimal formulation"),
    ],
)
def test_the_slow_part_is_named(arguments, module, slow, word, monkeypatch, tmp_path):
    active = []

    @contextlib.contextmanager
    def recorded(message, *, total=None, unit=""):
        active.append(message)
        yield Stage(message, total, unit, 0)
        active.pop()

    def stop(*_, **__):
        raise _ReachedError

    place = importlib.import_module(f"jaxbiped.cli.{module}")
    monkeypatch.setattr(place, "stage", recorded)
    *parts, name = slow.split(".")
    monkeypatch.setattr(functools.reduce(getattr, parts, jb), name, stop)
    with pytest.raises(_ReachedError):
        main(arguments.replace("OUT", str(tmp_path)).split())
    *_, message = active
    assert word in message

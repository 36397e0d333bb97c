"""What takes long in a command, against the word that names it."""

import contextlib
import importlib

import pytest

from jaxbiped.cli import main

WALK = ["walk", "--duration", "0.05"]
HELD = ["walk", "--formulation", "redundant", "--duration", "0.05"]


class _ReachedError(Exception):
    """The slow part began."""


@pytest.mark.parametrize(
    ("arguments", "module", "slow", "word"),
    [
        (WALK, "cli._walk", "Simulation.prepare", "start"),
        (WALK, "cli._walk", "Simulation.compile", "compiling"),
        (WALK, "cli._walk", "footsteps", "footsteps"),
        ([*WALK, "--out", "{out}"], "cli._walk", "write_outputs", "figures"),
        (HELD, "cli._walk", "Simulation.prepare", "start"),
        ([*WALK, "--model", "rigid"], "cli._rigid_walk", "rigid_walk", "compiling"),
        (["basin"], "cli._basin", "labelling", "gaits"),
        (["models"], "cli._models", "operation_counts", "counting"),
        (
            ["constraints"],
            "cli._constraint_comparison",
            "final_truth",
            "minimal formulation",
        ),
    ],
)
def test_the_slow_part_is_named(arguments, module, slow, word, monkeypatch, tmp_path):
    active = []

    @contextlib.contextmanager
    def recorded(message):
        active.append(message)
        yield
        active.pop()

    def stop(*_, **__):
        raise _ReachedError

    place = importlib.import_module(f"jaxbiped.{module}")
    monkeypatch.setattr(place, "stage", recorded)
    *parts, name = slow.split(".")
    monkeypatch.setattr(getattr(place, parts[0]) if parts else place, name, stop)
    with pytest.raises(_ReachedError):
        main([text.format(out=tmp_path) for text in arguments])
    (message,) = active
    assert word in message

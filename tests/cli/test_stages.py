"""What takes long in a command, against the word that names it."""

import pytest

from tests.cli.commands import asked

WALK = "walk --duration 0.05"


@pytest.mark.parametrize(
    ("arguments", "slow", "word"),
    [
        (WALK, "Simulation.prepare", "start"),
        (WALK, "Simulation.compile", "compiling"),
        (WALK, "footsteps", "footsteps"),
        (f"{WALK} --out OUT", "cli._walk_report.write_outputs", "figures"),
        (f"{WALK} --formulation redundant", "Simulation.prepare", "start"),
        (f"{WALK} --model rigid", "rigid_walk", "compiling"),
        ("basin", "labelling", "gaits"),
        ("models", "measure.operation_counts", "counting"),
        ("constraints", "cli._constraints.final_truth", "minimal formulation"),
    ],
)
def test_the_slow_part_is_named(arguments, slow, word, tmp_path):
    """By an interrupt, which says what was being done."""
    interrupt = KeyboardInterrupt()
    asked(arguments.replace("OUT", str(tmp_path)), slow, ends=interrupt)
    assert word in interrupt.__notes__[0]

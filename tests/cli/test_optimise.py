"""`jaxbiped optimise`, against its tables and JSON; each refusal is one sentence."""

import pytest

from tests.cli.commands import numbers_of, outputs_of, run
from tests.drawn import assert_is_drawn, points_of

pytestmark = pytest.mark.slow
RIGID = [
    "optimise",
    "--model",
    "rigid",
    "--maximise",
    "speed",
    "--basin",
    "64",
    "--footsteps",
    "20",
]


def test_numbers_and_tables(capsys, tmp_path):
    held = ["--vary", "d=0.08:0.12,r=0.06:0.1", "--subject-to", "step_length<0.19"]
    numbers = numbers_of(capsys, *RIGID, *held)
    assert set(numbers["variables"]) == {"d", "r"}
    assert numbers["objective"]["name"] == "speed"
    assert numbers["objective"]["value"] > numbers["history"][0]["objective"]
    certificate = numbers["certificate"]
    assert certificate["kkt_residual"] < 1e-3
    assert certificate["stable"] is True
    assert certificate["constraints"][0]["active"] is True
    assert len(certificate["multipliers"][0]) == 2
    assert certificate["unit_multiplier_error"] < 1e-5
    assert certificate["walk"]["returned"] is True
    assert certificate["basin"]["count"] > 0
    outputs = outputs_of(tmp_path, *RIGID, *held, "--columns", "2", "--style", "paper")
    assert "held by step_length" in capsys.readouterr().out
    assert outputs.numbers == numbers
    drawn = {"optimisation.png", "multipliers.png", "elasticities.png", "orbit.png"}
    assert set(outputs.figures) == {path.name for path in outputs.folder.iterdir()} == drawn
    for figure in outputs.figures.values():
        assert_is_drawn(figure)
        assert figure.get_figwidth() == 7.0
    speed = outputs.figures["optimisation.png"].axes[0]
    told = [each["objective"] for each in numbers["history"]]
    assert points_of(speed)[0][:, 1] == pytest.approx(told, rel=1e-12)


def test_a_design_without_a_gait_is_refused(capsys):
    assert run(*RIGID, "--vary", "d", "--slope", "-0.1") == 2
    said = capsys.readouterr()
    assert "the design to start from has no gait" in said.err
    assert len(said.err.strip().splitlines()[-1:]) == 1
    assert not said.out

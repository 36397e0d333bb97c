"""`jaxbiped fit`, against the parameters that its measurements were made with."""

import json

import pytest

import jaxbiped as jb
from tests.cli.commands import numbers_of, outputs_of, run
from tests.drawn import assert_is_drawn

pytestmark = pytest.mark.slow


@pytest.fixture
def file(tmp_path):
    gait = jb.find_gait(jb.ladder()["rigid"], parameters=(), radius_sensitivities=False)
    period, length = float(gait.measures.period), float(gait.measures.step_length)
    path = tmp_path / "measured.json"
    held = {"gaits": [{"period_s": [period, 1e-5], "step_length_m": [length, 1e-5]}]}
    path.write_text(json.dumps(held))
    return path


def test_a_table_and_its_numbers(file, tmp_path, capsys):
    numbers = tmp_path / "fit.json"
    words = ("--model", "rigid", "--J", "0.011", "--vary", "J,d", "--json", numbers)
    assert run("fit", file, *words) == 0
    shown = capsys.readouterr().out
    held = json.loads(numbers.read_text())
    truth = float(jb.parameter_values(jb.ladder()["rigid"])["J"])
    assert held["estimates"]["J"] == pytest.approx(truth, rel=1e-5)
    assert set(held) >= {"estimates", "standard_errors", "undetermined"}
    assert held["at_bounds"] == []
    assert held["p_value"] is None  # as many numbers as parameters
    assert "kg m^2" in shown
    assert "converged" in shown


def test_figures_of_all_formats(file, tmp_path):
    words = ("--model", "rigid", "--vary", "J,d", "--format", "pdf", "png", "--style", "paper")
    outputs = outputs_of(tmp_path, "fit", file, *words)
    assert set(outputs.figures) == {"fit.pdf", "fit.png"}
    assert {path.name for path in outputs.folder.iterdir()} == {"fit.pdf", "fit.png"}
    figure = outputs.figures["fit.png"]
    assert_is_drawn(figure)
    assert figure.get_figwidth() == 3.4


def test_only_json(file, capsys):
    held = numbers_of(capsys, "fit", file, "--model", "rigid", "--vary", "d")
    assert held["undetermined"] == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--vary", "stiffness"), "vary = 'stiffness' is not known"),
        (("--vary", ""), "vary = () is not allowed"),
        (("--vary", "J", "--json", "/nowhere/fit.json"), "cannot be written"),
        (("--vary", "J", "--accuracy", "loose"), "accuracy = 'loose' is not known"),
    ],
)
def test_bad_options(file, capsys, words, said):
    assert run("fit", file, "--model", "rigid", *words) == 2
    assert said in capsys.readouterr().err

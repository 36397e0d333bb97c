"""`jaxbiped optimise` and `fit`, against tables and JSON, and parameters of what was measured."""

import json

import pytest

import jaxbiped as jb
from tests.cli.commands import (
    asked,
    interrupt_after,
    numbers_of,
    one_line,
    outputs_of,
    refused,
    run,
)
from tests.drawn import assert_is_drawn, points_of

pytestmark = pytest.mark.slow
BRIEF = ["--basin", "64", "--footsteps", "20"]
RIGID = ["optimise", "--model", "rigid", "--maximise", "speed", *BRIEF]


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


def test_a_front_and_sensitivities_are_told_and_drawn(capsys, tmp_path):
    words = ["--vary", "d=0.08:0.12", "--front", "step_length<18.5cm:0.2:2"]
    outputs = outputs_of(tmp_path, *RIGID, *words, "--bifurcations", "none")
    printed = capsys.readouterr().out
    first, last = outputs.numbers["front"]
    assert [first["bound"], last["bound"]] == pytest.approx([0.185, 0.2])
    assert first["value"] == pytest.approx(0.185, rel=1e-6)
    assert first["bound_holds"] is first["proven"] is True
    assert first["outcome"] == "converged"
    assert f"{first['objective']:.6g}" in printed
    assert_is_drawn(outputs.figures["front.png"])
    known = {row["parameter"]: row for row in outputs.numbers["sensitivities"]}
    assert f"{known['slope']['objective']:.6g}" in printed
    assert 0.0 < known["slope"]["objective_error"] < 1e-3 * known["slope"]["objective"]
    assert set(known["slope"]["variables"]) == {"d"}


def test_a_design_without_a_gait_is_refused(capsys):
    assert run(*RIGID, "--vary", "d", "--slope", "-0.1") == 2
    said = capsys.readouterr()
    assert "the design to start from has no gait" in said.err
    assert len(said.err.strip().splitlines()[-1:]) == 1
    assert not said.out


@pytest.fixture
def file(tmp_path):
    gait = jb.find_gait(jb.ladder()["rigid"], parameters=(), radius_sensitivities=False)
    period, length = float(gait.measures.period), float(gait.measures.step_length)
    path = tmp_path / "measured.json"
    held = {"gaits": [{"period_s": [period, 1e-5], "step_length_m": [length, 1e-5]}]}
    path.write_text(json.dumps(held))
    return path


def test_a_table_of_a_fit_and_its_numbers(file, tmp_path, capsys):
    numbers = tmp_path / "fit.json"
    words = ("--model", "rigid", "--J", "0.011", "--vary", "J,d", "--json", numbers)
    assert run("fit", file, *words) == 0
    shown = capsys.readouterr().out
    held = json.loads(numbers.read_text())
    truth = float(jb.parameter_values(jb.ladder()["rigid"])["J"])
    assert held["estimates"]["J"] == pytest.approx(truth, rel=1e-5)
    assert set(held) >= {"estimates", "standard_errors", "undetermined"}
    assert held["at_bounds"] == held["undetermined"] == []
    assert held["p_value"] is None  # as many numbers as parameters
    assert "kg m^2" in shown
    assert "converged" in shown


def test_ctrl_c_keeps_the_best_estimates(file, tmp_path, monkeypatch, capsys):
    interrupt_after(monkeypatch, 1)
    numbers = tmp_path / "fit.json"
    words = ("--model", "rigid", "--J", "0.011", "--vary", "J,d", "--json", numbers)
    assert run("fit", file, *words) == 130
    printed, line = one_line(capsys)
    assert line == "jaxbiped: Interrupted: the best estimates so far are what is reported."
    held = json.loads(numbers.read_text())
    assert held["ending"] == "interrupted"
    assert held["estimates"]["J"] == pytest.approx(0.011, rel=0.3)
    assert "interrupted after" in printed


def test_figures_of_a_fit_in_all_formats(file, tmp_path):
    words = ("--model", "rigid", "--vary", "J,d", "--format", "pdf", "png", "--style", "paper")
    outputs = outputs_of(tmp_path, "fit", file, *words)
    assert set(outputs.figures) == {"fit.pdf", "fit.png"}
    assert {path.name for path in outputs.folder.iterdir()} == {"fit.pdf", "fit.png"}
    figure = outputs.figures["fit.png"]
    assert_is_drawn(figure)
    assert figure.get_figwidth() == 3.4


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--vary", "stiffness"), "vary = 'stiffness' is not known"),
        (("--vary", ""), "vary = () is not allowed"),
        (("--vary", "J", "--json", "/nowhere/fit.json"), "cannot be written"),
        (("--vary", "J", "--accuracy", "loose"), "accuracy = 'loose' is not known"),
    ],
)
def test_bad_options_of_a_fit(file, capsys, words, said):
    assert run("fit", file, "--model", "rigid", *words) == 2
    assert said in capsys.readouterr().err


def test_bounds_that_are_not_given_are_half_and_twice_the_value_as_far_as_it_may_be(capsys):
    """A leg is at least as long as its foot is high."""
    command = "optimise --model rigid --l 0.4 --r 0.3 --J 0.01 --minimise period --vary"
    bounds = asked(f"{command} 'J, d=0.05:0.2, l'", "optimise_gait")[1]["vary"]
    assert bounds["J"] == pytest.approx((0.005, 0.02))
    assert bounds["d"] == (0.05, 0.2)
    assert bounds["l"] == pytest.approx((0.3, 0.8), rel=1e-3)
    assert list(bounds) == ["J", "d", "l"]
    said = refused(f"{command} q", capsys)
    assert "vary = 'q' is not known: choose one of m, J" in said
    assert "vary = hip_mass needs bounds, as its value is 0" in refused(
        f"{command} hip_mass", capsys
    )

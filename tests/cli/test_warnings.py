"""What `jaxbiped walk` warns of, against walks that have it."""

import sys
import warnings

import pytest

from jaxbiped.cli import main
from tests.cli.commands import numbers_of

pytestmark = pytest.mark.slow


def test_an_ordinary_walk_has_no_warnings(capsys):
    numbers = numbers_of(capsys, "walk", "--duration", "1")
    assert numbers["warnings"] == []
    assert numbers["energy_residual_relative"] < 1e-4


def test_free_flight_is_airborne(capsys):
    numbers = numbers_of(capsys, "walk", "--hip-z", "100", "--duration", "1")
    assert numbers["ending"] == "airborne"
    (warning,) = numbers["warnings"]
    assert "--hip-z" in warning


def test_a_flight_that_came_down_is_none(capsys):
    assert (
        numbers_of(capsys, "walk", "--hip-z", "0.42", "--duration", "0.2")["ending"] != "airborne"
    )


@pytest.mark.parametrize(
    "arguments", [("--rtol", "0.3"), ("--hip-z", "5", "--omega-1", "1e4")], ids=["rtol", "spinning"]
)
def test_energy_left_open_is_a_warning_and_a_number(arguments, capsys):
    numbers = numbers_of(capsys, "walk", *arguments)
    (warning,) = (each for each in numbers["warnings"] if "left open" in each)
    assert numbers["energy_residual_relative"] > 1e-3
    assert f"{numbers['energy_residual_relative']:.2g}" in warning
    assert "--rtol" in warning


def test_a_cap_on_steps_bounds_a_walk_of_any_duration(capsys):
    """A duration of 1e9 s takes no more memory than the steps that are walked."""
    numbers = numbers_of(capsys, "walk", "--duration", "1e9", "--max-solver-steps", "1500")
    assert numbers["ending"] == "out of steps"
    (warning,) = numbers["warnings"]
    assert "1500" in warning
    assert "--max-solver-steps" in warning


def test_a_walk_that_ends_ends_whatever_its_duration(capsys):
    numbers = numbers_of(capsys, "walk", "--duration", "1e9", "--slope", "0.06")
    assert numbers["ending"] == "fell forward"


def test_steps_of_one_size_that_are_too_long(capsys):
    numbers = numbers_of(capsys, "walk", "--solver", "euler", "--dt", "1e-3", "--duration", "0.3")
    assert (numbers["solver"]["dt"], numbers["solver"]["rtol"]) == (1e-3, None)
    (warning,) = numbers["warnings"]
    assert "--dt" in warning


def test_a_warning_is_one_line_without_the_line_of_the_program(capsys, monkeypatch):
    monkeypatch.setattr(warnings, "showwarning", _as_python_shows)  # pytest records them otherwise
    usual = warnings.formatwarning
    with pytest.raises(SystemExit):
        main(["walk", "--slope", "1.15", "--duration", "0.2", "--json", "-"])
    (line,) = (each for each in capsys.readouterr().err.splitlines() if "degrees" in each)
    assert line.startswith("jaxbiped: warning: slope = 1.15 rad is steeper than friction can hold")
    assert warnings.formatwarning is usual


def _as_python_shows(message, category, filename, lineno, file=None, line=None):
    sys.stderr.write(warnings.formatwarning(message, category, filename, lineno, line))

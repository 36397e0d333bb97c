"""`jaxbiped walk` as a user meets it, against the published walk, and walks to be warned of."""

import json
import subprocess
import sys
import warnings

import pytest

from jaxbiped.cli import main
from tests.cli.commands import numbers_of, run
from tests.drawn import leg_pixels, sent_in

pytestmark = pytest.mark.slow


def _run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "jaxbiped", "walk", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """The command run once, with every output."""
    out = tmp_path_factory.mktemp("walk")
    result = _run("--duration", "3", "--out", str(out / "out"), "--json", str(out / "walk.json"))
    return out, result


def test_prints_a_table_and_the_ending(walk):
    _, result = walk
    assert result.returncode == 0, result.stderr
    assert "period s" in result.stdout
    assert "0.4415" in result.stdout
    assert "walking after 3 s" in result.stdout


def test_json_keys_and_numbers(walk):
    out, _ = walk
    numbers = json.loads((out / "walk.json").read_text())
    assert {"ending", "slope_rad", "steps", "energy_residual_J", "solver", "wall_s"} <= set(numbers)
    assert numbers["ending"] == "walking"
    assert numbers["slope_rad"] == 0.02
    keys = {"time_s", "period_s", "length_m", "speed_m_s", "peak_normal_N", "max_penetration_m"}
    assert keys <= set(numbers["steps"][0])
    assert numbers["steps"][0]["period_s"] == pytest.approx(0.4415, abs=1e-4)
    assert numbers["steps"][0]["peak_normal_N"] == pytest.approx(312, rel=0.01)
    assert {"name", "accepted", "rejected"} <= set(numbers["solver"])
    assert {"import", "compile", "run"} == set(numbers["wall_s"])
    assert abs(numbers["energy_residual_J"]) < 1e-5


def test_writes_pictures_an_animation_and_the_trajectory(walk):
    out, _ = walk
    names = {path.name for path in (out / "out").iterdir()}
    assert {"strobe.png", "contact_forces.png", "walk.gif", "trajectory.nc"} <= names
    pictures = [name for name in names if name.endswith((".png", ".gif"))]
    assert len(pictures) >= 5
    for name in pictures:
        # A phase portrait is of one leg, all else of both.
        assert sorted(leg_pixels(out / "out" / name))[-1] > 100, name
    assert min(leg_pixels(out / "out" / "strobe.png")) > 100
    assert min(leg_pixels(out / "out" / "walk.gif")) > 100


def test_writes_a_page_that_plays_the_walk_and_says_so(walk):
    out, result = walk
    page = (out / "out" / "walk.html").read_text()
    assert f"wrote {out / 'out' / 'walk.html'}" in result.stdout
    sent = sent_in(page)
    assert [each["ending"] for each in sent["walks"]] == ["walking"]
    assert len(page) < 1.5e6


def test_a_long_rigid_walk_is_played_as_far_as_it_is_drawn(tmp_path, capsys):
    assert run("walk", "--model", "rigid", "--duration", "70", "--out", tmp_path) == 0
    assert f"wrote {tmp_path / 'walk.html'}" in capsys.readouterr().out
    sent = sent_in((tmp_path / "walk.html").read_text())
    strikes = [each["t"] for each in sent["walks"][0]["footprints"]]
    assert 59.0 < strikes[-1] < 60.0


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
    cut = ("walk", "--duration", "1e9", "--max-solver-steps", "1500")
    numbers = numbers_of(capsys, *cut, code=1)
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

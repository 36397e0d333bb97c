"""`jaxbiped walk` as a user meets it, against the published walk."""

import json
import subprocess
import sys

import pytest

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


def test_json_to_standard_output_prints_only_that(capsys):
    numbers = numbers_of(capsys, "walk", "--slope", "0.04", "--duration", "5")
    assert numbers["ending"] == "fell forward"

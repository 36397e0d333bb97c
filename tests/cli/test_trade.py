"""`jaxbiped trade`, against errors that fall with the tolerance."""

import csv
import json

import pytest

import jaxbiped as jb
from jaxbiped import trade
from jaxbiped.trade import Row, Truth, failed_row
from tests.cli.commands import one_line, outputs_of, run
from tests.drawn import assert_is_drawn


@pytest.mark.nightly
def test_errors_and_costs_of_the_named_accuracies(tmp_path):
    code, folder, figures, numbers = outputs_of(tmp_path, "trade", "--duration", "0.5")
    assert code == 0
    axes = ("state", "step_time", "energy", "period", "multiplier", "gradient")
    assert set(figures) == {f"trade_{axis}.png" for axis in axes}
    for name, figure in figures.items():
        assert (folder / name).is_file()
        assert_is_drawn(figure)
    assert max(numbers["floors"]["walk"].values()) < 1e-9
    rows = numbers["rows"]
    assert all(row["outcome"] == "ok" and row["seconds"] > 0.0 for row in rows)
    usual = (("walk", "rodas4p", "state"), ("gait", "rodas4", "multiplier"))
    for of, solver, axis in usual:
        draft, balanced, tight = (
            row for row in rows if row["of"] == of and row["way"] == f"{solver} (lanes)"
        )
        settings = [row["setting"] for row in (draft, balanced, tight)]
        assert settings == ["draft", "balanced", "tight"]
        assert draft["errors"][axis] > balanced["errors"][axis] > tight["errors"][axis]
    best = numbers["cheapest"]["walk"]["state"]
    assert best["1e-08"]["setting"] == "tight"


class _Walk:
    """A trade whose third row is interrupted, or that has no truth."""

    def __init__(self, scene, *_):
        self.scene, self.rows = scene, 0

    def truth(self):
        return Truth({}, {}, {"state": 1e-12})

    def row(self, way, truth):
        self.rows += 1
        if self.rows == 3:
            raise KeyboardInterrupt
        errors = {"state": 1e-6} if self.rows == 1 else {}
        return Row(f"{way.solver} ({way.engine})", way.setting, "ok", errors, 1.0, 1.0, 1.0)


@pytest.fixture
def measured_by(monkeypatch):
    """Lets walks and gaits be measured by these."""

    def by(walks, gaits=trade.GaitTrade):
        monkeypatch.setattr(trade, "WalkTrade", walks)
        monkeypatch.setattr(trade, "GaitTrade", gaits)

    return by


class _Gait(_Walk):
    pass


class _NoGait(_Walk):
    def truth(self):
        return None


def test_ctrl_c_keeps_the_rows_that_are_measured(tmp_path, measured_by, capsys):
    measured_by(_Walk)
    numbers, table = tmp_path / "trade.json", tmp_path / "trade.csv"
    assert run("trade", "--json", numbers, "--csv", table) == 130
    printed, line = one_line(capsys)
    assert line == "jaxbiped: Interrupted: 2 settings are measured."
    assert [row["setting"] for row in json.loads(numbers.read_text())["rows"]] == [
        "draft",
        "balanced",
    ]
    assert "rodas4p (lanes)" in printed
    first, second = csv.DictReader(table.read_text().splitlines())
    assert first["of"] == "walk"
    assert (first["errors.state"], second["errors.state"]) == ("1e-06", "")


def test_a_walk_lasts_and_repeats_as_the_command_says(measured_by):
    asked = []

    def walk(scene, start, duration, repeats):
        asked.append((duration, repeats))
        return _NoGait(scene)

    measured_by(walk, _NoGait)
    run("trade", "--duration", "0.7", "--repeats", "5")
    assert asked == [(0.7, 5)]


def test_a_scene_without_a_gait_is_told_by_the_code(measured_by, capsys):
    measured_by(_NoGait, _NoGait)
    assert run("trade") == 1
    assert "gait: the references found none" in capsys.readouterr().out


def test_the_settings_of_a_walk_are_the_tolerances_of_its_accuracies(measured_by):
    ways = {_Walk: {}, _Gait: {}}

    def noted(self, way, truth):
        ways[type(self).__base__][way.setting] = way.rtol
        return failed_row(way.solver, way.setting, "no gait")

    measured_by(*(type(kind.__name__, (kind,), {"row": noted}) for kind in ways))
    assert run("trade") == 0
    settings = dict(ways[_Walk])
    for name in jb.ACCURACIES:
        request = jb.Simulation.prepare(
            jb.seed_scene(), jb.seed_state(), duration=1.0, accuracy=name
        )
        assert settings.pop(name) == float(request.rtol)
    assert settings == {}
    assert run("trade", "--full") == 0
    assert list(ways[_Gait])[3:5] == ["rtol=0.001", "rtol=0.0001"]

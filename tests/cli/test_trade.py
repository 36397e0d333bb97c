"""`jaxbiped trade`, against errors that fall with the tolerance."""

import json

import pytest

import jaxbiped as jb
from jaxbiped import trade
from jaxbiped.cli._trade import Trade
from jaxbiped.trade import Row, Truth
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
        return Row(
            f"{way.solver} ({way.engine})", way.setting, "ok", {"state": 1e-6}, 1.0, 1.0, 1.0
        )


class _NoGait(_Walk):
    def truth(self):
        return None


def test_ctrl_c_keeps_the_rows_that_are_measured(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(trade, "WalkTrade", _Walk)
    numbers = tmp_path / "trade.json"
    assert run("trade", "--json", numbers) == 130
    printed, line = one_line(capsys)
    assert line == "jaxbiped: Interrupted: 2 settings are measured."
    assert [row["setting"] for row in json.loads(numbers.read_text())["rows"]] == [
        "draft",
        "balanced",
    ]
    assert "rodas4p (lanes)" in printed


def test_a_scene_without_a_gait_is_told_by_the_code(monkeypatch, capsys):
    monkeypatch.setattr(trade, "WalkTrade", _NoGait)
    monkeypatch.setattr(trade, "GaitTrade", _NoGait)
    assert run("trade") == 1
    assert "gait: the references found none" in capsys.readouterr().out


def test_the_settings_of_a_walk_are_the_tolerances_of_its_accuracies():
    scene, state = jb.seed_scene(), jb.seed_state()
    settings = dict(Trade()._settings("walk", scene))
    for name in jb.ACCURACIES:
        request = jb.Simulation.prepare(scene, state, duration=1.0, accuracy=name)
        assert settings.pop(name) == float(request.rtol)
    assert settings == {}
    assert list(dict(Trade(full=True)._settings("gait", scene)))[3:5] == [
        "rtol=0.001",
        "rtol=0.0001",
    ]

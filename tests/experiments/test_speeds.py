"""Speeds, at their quick size, against results that must be right and lanes' bits."""

import pytest

from tests.compiler.fake_driver import install
from tests.drawn import points_of
from tests.experiments.quick import drawn_run, quick_run

pytestmark = pytest.mark.nightly


def test_without_a_device_it_says_so(tmp_path, monkeypatch):
    install(monkeypatch, devices=0)
    numbers, figures = quick_run("gpu_speed", tmp_path)
    assert numbers["missing"] == "there is no CUDA device"
    assert not figures
    assert not {"walks", "labels", "peak_flops"} & set(numbers)
    for row in numbers["assembled"]:
        assert row["registers"] <= 255
        assert row["warps"] == 8


def test_where_a_device_is_it_runs_to_its_end(tmp_path, monkeypatch):
    install(monkeypatch, lanes=2, multiprocessors=1)
    numbers, _ = drawn_run("gpu_speed", tmp_path, unitless={"starts in the batch"})
    assert numbers["devices"] == ["emulated 0"]
    assert numbers["peak_flops"] > 0.0
    assert [row["same_bits"] for row in numbers["errors"]] == [1.0]
    assert [row["labels_that_differ"] for row in numbers["labels"]] == [0]


def test_what_lanes_are_timed_by_is_right(tmp_path):
    counts = {"simulations in the batch", "simulations of 2 s a second"}
    numbers, figures = drawn_run("lanes_speed", tmp_path, unitless=counts, alone=True)
    ways = {row["way"] for row in numbers["singles"]}
    assert {"lanes", "lanes, rodas4", "xla"} <= ways
    assert all(row["error"] < 1e-3 for row in numbers["singles"])
    assert numbers["batches"]
    assert all(row["error_median"] < 1e-3 for row in numbers["batches"])
    assert "lanes" in {row["way"] for row in numbers["derivatives"]}
    ours = [row for row in numbers["derivatives"] if row["way"] != "CasADi CVODES"]
    assert all(0.0 < row["error"] < 1e-4 for row in ours)
    gaits = {"lanes, with the radius's", "lanes, without the radius's"}
    assert set(numbers["gaits_s"]) == set(numbers["gait_periods_s"]) == gaits
    for period in numbers["gait_periods_s"].values():
        assert period == pytest.approx(0.4408349, abs=1e-7)
    batches, alone = figures["lanes_speed.png"].axes
    shown = points_of(batches, "lanes")[0][:, 1].tolist()
    rows = [row for row in numbers["batches"] if row["way"] == "lanes"]
    assert shown == [row["simulations_per_s"] for row in rows]
    assert {line.get_label() for line in alone.lines} == ways


def test_what_mechanisms_are_timed_by_is_right(tmp_path):
    bare = {"bodies of a chain"}
    numbers, _ = drawn_run("mechanism_speed", tmp_path, unitless=bare, alone=True)
    ours = [row for row in numbers["rates"]["rows"] if row["way"] == "lanes"]
    assert all(0.0 < row["error_median"] < 1e-4 for row in ours)
    assert all(row["error_median"] < 1e-3 for row in numbers["rates"]["rows"] if "rtol" in row)
    assert numbers["rates"]["floor"] is None or numbers["rates"]["floor"] < 1e-7
    assert 0.0 < numbers["exponent"] < 1.2
    seed, *kneed = numbers["rigid_walks"]
    assert seed["ratio"] == 1.0
    assert [row["walked"] for row in numbers["rigid_walks"]] == [1.0] * 3
    # Of each footstep at least the strike is landed on, and with knees the knee's lock too.
    assert all(row["accepted"] > seed["accepted"] > row["footsteps"] for row in kneed)

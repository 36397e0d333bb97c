"""Errors and what is said of them, at the quick size, against far finer and precise solves."""

import numpy as np
import pytest

from tests.experiments.quick import drawn_run

pytestmark = pytest.mark.nightly


def test_true_errors_lie_within_their_bars(tmp_path):
    numbers, _ = drawn_run("accuracy_coverage", tmp_path)
    assert numbers["walks"]["silently_wrong"] == numbers["rigid"]["silently_wrong"] == 0
    state, rigid = (numbers["coverage"][name] for name in ("state", "rigid state"))
    assert state["resolved"] >= 40
    assert state["covered"] >= 0.9 * state["resolved"]
    # Components of one walk err together: at most one of these few scenes lies beyond its bars.
    assert rigid["scenes_all_covered"] >= rigid["scenes"] - 1 > 0
    assert rigid["worst_ratio"] < 4.0
    assert set(numbers["coverage"]) >= {"period", "multipliers", "sensitivities"}


def test_few_labels_change_and_those_in_doubt_are_told(tmp_path):
    numbers, _ = drawn_run("label_accuracy", tmp_path)
    changed = {row["way"]: row["changed"] for row in numbers["named"]["rows"]}
    assert changed["tight"] <= changed["draft"] <= 0.02 * numbers["starts"]
    assert numbers["named"]["references_differ"] <= 1
    for (row,) in numbers["by_number"].values():
        assert row["truly_wrong"] <= row["wanted"] * numbers["starts"]
        assert row["within_interval"] == row["draws"] == 1
        assert 1.0 < row["steps_ratio"] < 3.5
    # Fractions lie in their intervals, and scatter less if starts are even.
    for name in ("rigid", "compliant"):
        uniform, sobol = (numbers["fractions"][name][method] for method in ("uniform", "sobol"))
        for found in (uniform, sobol):
            assert sum(each["fraction"] for each in found.values()) == pytest.approx(1.0)
            assert all(each["inside_95"] >= 0.6 for each in found.values())
        assert sobol["walking"]["scatter"] < uniform["walking"]["scatter"]


def test_no_extreme_is_silently_wrong(tmp_path):
    numbers, _ = drawn_run("extremes", tmp_path, unitless={"cases"})
    assert numbers["run"] == numbers["catalogue"] >= 60
    assert numbers["silently_wrong"] == numbers["gaits"]["silently_wrong"] == 0
    assert numbers["accurate"] > 0.7 * numbers["run"]
    assert numbers["gaits"]["compared"] >= 2
    counted = {name: np.sum(told, axis=0)[1:] for name, told in numbers["by_value"].items()}
    for name, found in counted.items():
        group = numbers["groups"][name]
        assert found.tolist() == [group[verdict] for verdict in group if verdict != "run"]
    for graze, least in zip(numbers["grazing"], (4, 8), strict=True):
        assert graze["derivatives"] == 8
        assert graze["accurate"] >= least
        assert graze["silently_wrong"] == 0

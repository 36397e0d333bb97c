"""Sweeps of labels, at their quick size, against labels by SciPy, in memory and of one worker."""

import numpy as np
import pytest

from tests.drawn import points_of
from tests.experiments.quick import drawn_run, quick_run

pytestmark = pytest.mark.nightly


def test_peers_see_the_same_starts_walk(tmp_path):
    bare = {"starts in the batch", "labelled starts that walk, a second"}
    numbers, figures = drawn_run("throughput", tmp_path, unitless=bare, alone=True)
    assert [row["size"] for row in numbers["sizes"]] == [500, 2000]
    assert all(row["walking_agrees"] == 1.0 for row in numbers["peers"])
    independent = [row for row in numbers["peers"] if row["way"] == "SciPy LSODA"]
    assert [row["which"] for row in independent] == ["that walk"]
    assert [(row["starts"], row["fates_agree"]) for row in independent] == [(8, 1.0)]
    both = [(row["engine"], row["labels_agree"]) for row in numbers["engines"]]
    assert both == [("lanes", 1.0), ("xla", 1.0)]
    shown = points_of(figures["throughput.png"].axes[0], "compliant")[0].tolist()
    assert shown == [[row["size"], row["us_each"]] for row in numbers["sizes"]]


def test_a_killed_sweep_is_resumed_to_the_same_labels(tmp_path):
    numbers, _ = quick_run("sweep_store", tmp_path)
    assert numbers["runs"]
    for run in numbers["runs"]:
        assert run["killed"] == len(run["kills"])
        assert 0 < run["labelled_in_last_run"] < run["starts"]
        assert run["pending"] == 0
        assert run["differ_from_memory"] == 0
    assert [row["workers"] for row in numbers["workers"]] == [1, 2]
    for row in numbers["workers"]:
        assert row["starts"] == 1024
        assert row["labels_differ"] == 0
        assert row["best"] == max(row["starts_per_s"]) > 0.0


def test_lanes_give_the_same_bits_and_xla_what_an_ulp_does(tmp_path):
    numbers, _ = drawn_run("reproducibility", tmp_path)
    rows = {row["name"]: row for row in numbers["rows"]}
    moved = rows.pop("lanes, start one ulp away")
    xla = rows.pop("XLA")
    assert {"lanes, 256 bits, threads: 1", "lanes, batches of 7"} <= rows.keys()
    for row in rows.values():
        assert row["same_bits"] == numbers["walks"], row["name"]
        assert row["labels"] == row["gait"] == 0
    assert moved["same_bits"] == 0
    assert 0.0 < xla["median"] < 3.0 * moved["median"]
    assert xla["endings"] == 0
    # A line of the picture, from the walk that differs most to the one that differs least.
    walks, points = numbers["walks"], np.array(xla["exceeded"])
    assert points[0].tolist() == [xla["largest"], 1.0 / walks]
    assert points[-1, 1] == 1.0
    assert np.all(np.diff(points[:, 0]) <= 0.0)
    assert np.all(np.diff(points[:, 1]) > 0.0)

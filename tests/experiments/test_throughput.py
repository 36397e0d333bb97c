"""Labelled starts a second, at the quick size, against fates by SciPy and by peers."""

import pytest

from tests.drawn import assert_is_drawn, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_peers_see_the_same_starts_walk(tmp_path):
    numbers, figures = quick_run("throughput", tmp_path, alone=True)
    assert [row["size"] for row in numbers["sizes"]] == [500, 2000]
    assert [row["chunk"] for row in numbers["chunks"]] == [512, 2048]
    assert [row["threads"] for row in numbers["by_threads"]] == [1, 2]
    for row in numbers["peers"]:
        assert row["walking_agrees"] == 1.0
    independent = [row for row in numbers["peers"] if row["way"] == "SciPy LSODA"]
    assert [row["which"] for row in independent] == ["that walk", "that fall"]
    for row in independent:
        assert row["starts"] == 8
        assert row["fates_agree"] == 1.0
    both = [(row["engine"], row["labels_agree"]) for row in numbers["engines"]]
    assert both == [("lanes", 1.0), ("xla", 1.0)]
    (figure,) = figures.values()
    assert_is_drawn(figure, unitless={"starts in the batch", "labelled starts that walk, a second"})
    shown = points_of(figure.axes[0], "compliant")[0].tolist()
    assert shown == [[row["size"], row["us_each"]] for row in numbers["sizes"]]

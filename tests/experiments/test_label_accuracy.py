"""Accuracy of labels, at the quick size, against labels of tighter solves."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_few_labels_change_and_those_in_doubt_are_told(tmp_path):
    numbers, figures = quick_run("label_accuracy", tmp_path)
    bare = ("relative tolerance", "share of labels that a finer solve changes")
    assert_is_drawn(figures["label_accuracy.png"], unitless=bare)
    changed = {row["way"]: row["changed"] for row in numbers["named"]["rows"]}
    assert changed["tight"] <= changed["draft"] <= 0.02 * numbers["starts"]
    assert numbers["named"]["references_differ"] <= 1
    for (row,) in numbers["by_number"].values():
        assert row["truly_wrong"] <= row["wanted"] * numbers["starts"]
        assert row["within_interval"] == row["draws"] == 1
        assert 1.0 < row["steps_ratio"] < 3.5

"""Sweeps by two worker processes, at the quick size, against the labels of one."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_two_workers_find_the_labels_of_one(tmp_path):
    numbers, figures = quick_run("process_scaling", tmp_path, alone=True)
    assert [row["workers"] for row in numbers["rows"]] == [1, 2]
    for row in numbers["rows"]:
        assert row["starts"] == 1024
        assert row["labels_differ"] == 0
        assert min(row["starts_per_s"]) > 0.0
    ratio = numbers["rows"][1]["best"] / numbers["rows"][0]["best"]
    assert numbers["efficiency"] == pytest.approx(ratio / 2.0)
    (figure,) = figures.values()
    assert_is_drawn(
        figure, unitless={"worker processes of one core each", "labelled starts a second"}
    )

"""A killed sweep continued, at its quick size, against the labels of one in memory."""

import pytest

from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_a_killed_sweep_is_resumed_to_the_same_labels(tmp_path):
    numbers, _ = quick_run("sweep_store", tmp_path)
    assert numbers["runs"]
    for run in numbers["runs"]:
        assert run["killed"] == len(run["kills"])
        assert 0 < run["labelled_in_last_run"] < run["starts"]
        assert run["pending"] == 0
        assert run["differ_from_memory"] == 0

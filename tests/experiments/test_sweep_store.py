import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow


def test_a_killed_sweep_is_resumed_to_the_same_labels(tmp_path):
    numbers = quick_numbers("sweep_store", tmp_path, keys={"runs"}, pictures=set())
    for run in numbers["runs"]:
        assert run["killed"] == len(run["kills"])
        assert 0 < run["labelled_in_last_run"] < run["starts"]
        assert run["pending"] == 0
        assert run["differ_from_memory"] == 0

import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow


def test_what_is_timed_is_right(tmp_path):
    numbers = quick_numbers(
        "lanes_speed",
        tmp_path,
        keys={"batches", "singles", "derivatives", "gaits_s", "share_of_peak", "scenes"},
        pictures={"lanes_speed.png"},
    )
    ways = {row["way"] for row in numbers["singles"]}
    assert {"lanes", "xla"} <= ways
    assert all(row["error"] < 1e-3 for row in numbers["singles"])
    assert all(row["error_median"] < 1e-3 for row in numbers["batches"])

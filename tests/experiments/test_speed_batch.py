import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow


def test_every_lane_arrives(tmp_path):
    numbers = quick_numbers(
        "speed_batch",
        tmp_path,
        keys={"compile_s", "rows", "errors"},
        pictures={"speed_batch.png"},
    )
    ours = [row for row in numbers["rows"] if row["way"] == "vmap"]
    assert ours
    assert all(row["failed"] == 0 and row["steps_per_second"] > 0 for row in ours)

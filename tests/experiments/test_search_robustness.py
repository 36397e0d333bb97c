import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow


def test_no_gait_that_walks_settle_on_is_missed(tmp_path):
    numbers = quick_numbers(
        "search_robustness",
        tmp_path,
        keys={"slope", "mu", "simplest"},
        pictures={"search_robustness.png"},
    )
    rows = [row for family in numbers.values() for row in family]
    assert not [row for row in rows if row["verdict"] == "missed"]
    assert [row["verdict"] for row in numbers["slope"]] == ["agrees"] * 3
    for row in numbers["slope"]:
        assert abs(row["period"] - row["walked"]) < 1e-6

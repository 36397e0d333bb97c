import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow


def test_peers_see_the_same_starts_walk(tmp_path):
    numbers = quick_numbers(
        "throughput",
        tmp_path,
        keys={"sizes", "chunks", "by_threads", "peers", "engines"},
        pictures={"throughput.png"},
    )
    assert {"ours", "SciPy LSODA"} <= {row["way"] for row in numbers["peers"]}
    for row in numbers["peers"]:
        assert row["walking_agrees"] > 0.99
        assert row["fates_agree"] > 0.85

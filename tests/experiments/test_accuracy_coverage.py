"""Coverage of error bars, at its quick size, against far finer solves."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_true_errors_lie_within_their_bars(tmp_path):
    numbers, figures = quick_run("accuracy_coverage", tmp_path)
    assert_is_drawn(figures["accuracy_coverage.png"])
    assert numbers["walks"]["silently_wrong"] == 0
    state = numbers["coverage"]["state"]
    assert state["resolved"] >= 40
    assert state["covered"] >= 0.9 * state["resolved"]
    assert numbers["rigid"]["silently_wrong"] == 0
    rigid = numbers["coverage"]["rigid state"]
    # Components of one walk err together: at most one of these few scenes lies beyond its bars.
    assert rigid["scenes_all_covered"] >= rigid["scenes"] - 1 > 0
    assert rigid["worst_ratio"] < 4.0
    assert set(numbers["coverage"]) >= {"period", "multipliers", "sensitivities"}

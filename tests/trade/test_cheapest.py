"""Cost at an equal error, against a power law."""

import pytest

from jaxbiped.trade import Row, cheapest, cost_at


def _row(error, steps, way="a", outcome="ok"):
    return Row(way, f"{error:g}", outcome, {"state": error}, attempted=steps)


def _steps(row):
    return row.attempted


def test_a_power_law_is_followed_between_settings():
    """Steps = error^(-1/4), a method of order four."""
    rows = [_row(error, error**-0.25) for error in (1e-2, 1e-4, 1e-8)]
    for error in (1e-3, 1e-4, 1e-6):
        assert cost_at(rows, "state", error, _steps) == pytest.approx(error**-0.25)


def test_an_error_that_is_never_reached_has_no_cost():
    rows = [_row(1e-2, 10), _row(1e-4, 20)]
    assert cost_at(rows, "state", 1e-5, _steps) is None
    assert cost_at(rows, "state", 1e-1, _steps) == pytest.approx(10)
    assert cost_at(rows, "energy", 1e-3, _steps) is None
    assert cost_at([], "state", 1e-3, _steps) is None


def test_failures_are_not_on_the_way():
    rows = [_row(1e-2, 10), _row(1e-9, 1, outcome="wrong"), _row(1e-4, 40)]
    assert cost_at(rows, "state", 1e-3, _steps) == pytest.approx(20)


def test_the_cheapest_row_that_reaches_the_error():
    rows = [_row(1e-3, 5), _row(1e-5, 50), _row(1e-6, 30, way="b"), _row(0.0, 1)]
    assert cheapest(rows, "state", 1e-4, _steps).way == "b"
    assert cheapest(rows, "state", 1e-2, _steps).attempted == 5
    assert cheapest(rows, "state", 1e-7, _steps) is None

"""Rows and truths of a study, against power laws and solves that are close, far off or failed."""

import json

import numpy as np
import pytest

from jaxbiped.trade import Row, Way, Work, cheapest, cost_at, failed_row, row_of, truth_of, work_of


def test_a_way_is_named_apart_from_its_setting():
    tight, draft = (Way("rodas4", "lanes", s, r) for s, r in (("tight", 2e-9), ("draft", 1e-5)))
    assert tight.name == draft.name == "rodas4 (lanes)"


def test_the_first_run_does_not_count_as_a_warm_one():
    calls = []
    found, work = work_of(lambda: calls.append(0) or len(calls), repeats=3)
    assert (found, len(calls)) == (4, 4)
    assert min(work) >= 0.0


TRUTH = truth_of({"state": np.array([1.0, 0.0])}, {})
WORK = Work(1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("value", "ended", "told", "error"),
    [
        (1.001, "ok", "ok", pytest.approx(1e-3)),
        (1.5, "ok", "wrong", 0.5),
        (np.nan, "ok", "wrong", None),
        (1.5, "out of steps", "out of steps", 0.5),
    ],
)
def test_a_solve_that_ends_far_off_is_wrong_and_kept(value, ended, told, error):
    """One that says that it failed keeps its word."""
    found = {"state": np.array([value, 0.0])}
    row = row_of("a", "rtol=1", ended, TRUTH, found, WORK, attempted=7)
    assert row.outcome == told
    assert row.errors == {"state": error}
    assert (row.seconds, row.cpu_s, row.compile_s, row.attempted) == (1.0, 2.0, 3.0, 7)
    assert json.loads(json.dumps(row.numbers()))["errors"] == {"state": error}


def test_what_never_ran_has_no_errors_and_took_no_time():
    row = failed_row("a", "rtol=1", "not installed")
    assert (row.errors, row.cpu_s, row.outcome) == ({}, None, "not installed")


def test_a_solve_that_is_far_off_in_one_of_its_numbers_is_wrong():
    values = {"state": np.array([1.0, 0.0]), "period": np.array([2.0])}
    for period, outcome in ((2.08, "ok"), (2.12, "wrong")):
        found = values | {"period": np.array([period])}
        row = row_of("a", "rtol=1", "ok", truth_of(values, {}), found, WORK)
        assert row.outcome == outcome
        assert row.errors == pytest.approx({"state": 0.0, "period": 0.5 * period - 1.0})


def _cheap_row(error, steps, way="a", outcome="ok"):
    return Row(way, f"{error:g}", outcome, {"state": error}, attempted=steps)


def _steps(row):
    return row.attempted


def test_a_power_law_is_followed_between_settings():
    """Steps = error^(-1/4), a method of order four."""
    rows = [_cheap_row(error, error**-0.25) for error in (1e-2, 1e-4, 1e-8)]
    for error in (1e-3, 1e-4, 1e-6):
        assert cost_at(rows, "state", error, _steps) == pytest.approx(error**-0.25)


def test_an_error_that_is_never_reached_has_no_cost_and_failures_are_not_on_the_way():
    rows = [_cheap_row(1e-2, 10), _cheap_row(1e-9, 1, outcome="wrong"), _cheap_row(1e-4, 40)]
    assert cost_at(rows, "state", 1e-5, _steps) is None
    assert cost_at(rows, "state", 1e-1, _steps) == pytest.approx(10)
    assert cost_at(rows, "state", 1e-3, _steps) == pytest.approx(20)
    assert cost_at(rows, "energy", 1e-3, _steps) is None
    assert cost_at([], "state", 1e-3, _steps) is None


def test_the_cheapest_row_that_reaches_the_error():
    rows = [
        _cheap_row(1e-3, 5),
        _cheap_row(1e-5, 50),
        _cheap_row(1e-6, 30, way="b"),
        _cheap_row(0.0, 1),
    ]
    assert cheapest(rows, "state", 1e-4, _steps).way == "b"
    assert cheapest(rows, "state", 1e-2, _steps).attempted == 5
    assert cheapest(rows, "state", 1e-7, _steps) is None


def test_errors_count_in_units_of_their_axis():
    values = {
        "state": np.array([0.1, 20.0]),
        "period": np.array([0.5]),
        "multiplier": np.array([0.25]),
    }
    truth = truth_of(values, {name: value + 1e-6 for name, value in values.items()})
    assert truth.floor == pytest.approx({"state": 1e-6, "period": 2e-6, "multiplier": 1e-6})
    found = truth.errors({"state": np.array([0.1, 20.5]), "gradient": np.ones(3)})
    assert found == pytest.approx({"state": 0.5})


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_axis_is_as_large_as_its_largest_number_of_either_sign(sign):
    truth = truth_of({"gradient": sign * np.array([-8.0, 2.0])}, {})
    found = truth.errors({"gradient": sign * np.array([-8.0, 4.0])})
    assert found == pytest.approx({"gradient": 0.25})


@pytest.mark.parametrize("found", [np.array([1.0]), np.array([np.nan, 1.0]), np.ones((2, 2))])
def test_what_is_no_number_or_too_few_is_off_by_infinity(found):
    truth = truth_of({"step_time": np.array([1.0, 2.0])}, {})
    assert truth.errors({"step_time": found}) == {"step_time": np.inf}


def test_what_never_happened_has_no_error():
    truth = truth_of({"step_time": np.zeros(0)}, {"step_time": np.zeros(0)})
    assert truth.floor == {}
    assert truth.errors({"step_time": np.zeros(0)}) == {}

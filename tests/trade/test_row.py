"""Rows of a trade study, against solves that are close, far off, failed or never ran."""

import json

import numpy as np
import pytest

from jaxbiped.trade import Work, failed_row, row_of, truth_of

TRUTH = truth_of({"state": np.array([1.0, 0.0])}, {})
WORK = Work(1.0, 2.0, 3.0)


def _row(value, outcome="ok"):
    found = {"state": np.array([value, 0.0])}
    return row_of("a", "rtol=1", outcome, TRUTH, found, WORK, attempted=7)


def test_a_solve_that_is_close_is_ok():
    row = _row(1.001)
    assert row.outcome == "ok"
    assert row.errors["state"] == pytest.approx(1e-3)
    assert (row.seconds, row.cpu_s, row.compile_s, row.attempted) == (1.0, 2.0, 3.0, 7)


@pytest.mark.parametrize(("value", "error"), [(1.5, 0.5), (np.nan, None)])
def test_a_solve_that_ends_far_off_is_wrong_and_kept(value, error):
    row = _row(value)
    assert row.outcome == "wrong"
    assert row.errors == {"state": error}
    assert json.loads(json.dumps(row.numbers()))["errors"] == {"state": error}


def test_a_solve_that_says_that_it_failed_keeps_its_word():
    assert _row(1.5, "out of steps").outcome == "out of steps"


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

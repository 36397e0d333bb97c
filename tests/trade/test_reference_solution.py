"""Errors against a truth: in units of their axis, infinite or none where they must be."""

import numpy as np
import pytest

from jaxbiped.trade import truth_of


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


@pytest.mark.parametrize("found", [np.array([1.0]), np.array([np.nan, 1.0]), np.ones((2, 2))])
def test_what_is_no_number_or_too_few_is_off_by_infinity(found):
    truth = truth_of({"step_time": np.array([1.0, 2.0])}, {})
    assert truth.errors({"step_time": found}) == {"step_time": np.inf}


def test_what_never_happened_has_no_error():
    truth = truth_of({"step_time": np.zeros(0)}, {"step_time": np.zeros(0)})
    assert truth.floor == {}
    assert truth.errors({"step_time": np.zeros(0)}) == {}

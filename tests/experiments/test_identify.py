"""Estimates of parameters, at the quick size, against the truth their data were made of."""

import pytest

from tests.drawn import assert_is_drawn, labels_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_estimates_scatter_as_their_errors_say(tmp_path):
    run = quick_run("identify", tmp_path)
    numbers = run.numbers
    assert numbers["converged"] == numbers["sets"] == 3
    assert numbers["undetermined_with_xi"] == ["xi"]
    for held in numbers["parameters"].values():
        # Three estimates scatter; four standard errors are a wide gate, a wrong Jacobian wider.
        off = abs(held["mean_estimate"] - held["truth"])
        assert off < 4.0 * held["mean_standard_error"]
        assert 0.0 < held["mean_standard_error"] < 0.1 * held["truth"]
    (figure,) = run.figures.values()
    assert_is_drawn(figure, unitless=set(labels_of(figure)))

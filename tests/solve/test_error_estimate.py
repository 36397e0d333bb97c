"""Refinement of tolerances, against errors that are a power of the tolerance."""

import warnings

import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.solve._error_estimate import error_numbers, error_sentence, refine
from jaxbiped.solve.solvers import rms_norm

DOUBLE = np.dtype(float)


def errors(power, *, floor=0.0, hopeless="", calls=None):
    """Attempts whose error is 100 times the tolerance to this power, at least a floor."""

    def attempt(tolerance):
        if calls is not None:
            calls.append(tolerance)
        return tolerance, ({"x": tolerance}, max(100.0 * tolerance**power, floor), hopeless)

    return attempt


def falling(ratio):
    """Attempts each of whose errors is so much of the last one, whatever the tolerance."""
    left = iter(3e-8 * ratio ** np.arange(6))
    return lambda tolerance: (tolerance, ({}, float(next(left)), ""))


def test_a_tolerance_is_tightened_until_the_error_is_what_is_wanted():
    calls = []
    result, error = refine(errors(1.0, calls=calls), 1e-6, first=1e-4, dtype=DOUBLE)
    # The next tolerance aims at 0.3 of what is wanted, at least a thousandth of the last.
    assert calls == pytest.approx([1e-4, 1e-7, 3e-9])
    assert (error.met, error.rounds, error.reason) == (True, 3, "")
    assert error.relative == pytest.approx(3e-7)
    assert error.rtol == pytest.approx(3e-9) == result
    assert error.bars == {"x": result}
    at_once = refine(errors(1.0), 2e-2, first=1e-4, dtype=DOUBLE)[1]
    assert (at_once.rounds, at_once.rtol) == (1, 1e-4)


@pytest.mark.parametrize(
    ("attempt", "finest", "reason"),
    [
        (errors(1.0, floor=1e-5), 1e-12, "rounding of float64: finer steps gain nothing"),
        (errors(1.0), 1e-6, "1e-06 is the finest tolerance"),
        (errors(1.0, hopeless="the foot grazes"), 1e-12, "the foot grazes"),
        (falling(0.66), 1e-14, "6 tolerances were tried"),
    ],
)
def test_what_cannot_be_met_says_why_and_keeps_the_best(attempt, finest, reason):
    with pytest.warns(RuntimeWarning, match="accuracy = 1e-09 is not met"):
        _, error = refine(attempt, 1e-9, first=1e-4, dtype=DOUBLE, finest=finest)
    assert not error.met
    assert error.reason == reason
    assert reason in error_sentence(error)
    assert error_numbers(error)["relative"] == error.relative


def test_an_error_that_is_not_known_is_sought_ten_times_finer():
    known = {1e-4: np.inf, 1e-5: np.inf, 1e-6: 1e-7}

    def attempt(tolerance):
        (error,) = (e for t, e in known.items() if t == pytest.approx(tolerance))
        return tolerance, ({}, error, "")

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert refine(attempt, 1e-6, first=1e-4, dtype=DOUBLE)[1].rtol == pytest.approx(1e-6)


def test_the_norm_is_the_root_of_the_mean_square_over_all_leaves():
    assert float(rms_norm((jnp.asarray(3.0), jnp.asarray([4.0, 0.0])))) == pytest.approx(
        np.sqrt(25.0 / 3.0)
    )

"""Error control, against its formula: which steps are kept, how large the next is."""

import dataclasses

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import count_operations
from jaxbiped.hybrid._scales import units_of
from jaxbiped.solve.controllers._step_size import (
    SAFETY,
    SMALLEST_STEP,
    ErrorControl,
    step_control,
)
from jaxbiped.solve.solvers import rms_norm

RTOL, SPAN = 1e-6, 1e-3
STATE = jb.seed_state()
UNITS = units_of(jb.seed_scene(), STATE)
ORDER = 4


def _adapted(error, *, rejected=False, span=SPAN, order=ORDER, at=0.5, grown=1.0, dtype=float):
    """What becomes of a step from the start to `grown` times it, with errors of so many tolerances.

    One number for all leaves, or one for each.
    """
    y0, y1, tolerance = (
        np.array([float(x) for x in each])
        for each in (STATE, [grown * x for x in STATE], [1.0 / x for x in UNITS.inverse])
    )
    errors = error * (1e-2 * RTOL * tolerance + RTOL * np.maximum(np.abs(y0), np.abs(y1)))
    units = jtu.tree_map(lambda unit: jnp.asarray(unit, dtype), UNITS)
    before, after, errors = (
        jb.State(*(jnp.asarray(x, dtype) for x in each)) for each in (y0, y1, errors)
    )
    times = jnp.asarray(at, dtype), jnp.asarray(at + span, dtype)
    control = ErrorControl(RTOL, 1e-2 * RTOL, units)
    return control.adapt_step_size(
        *times, before, after, None, errors, order, jnp.asarray(rejected)
    )


@pytest.mark.parametrize("order", [3, 4, 5])
@pytest.mark.parametrize(("error", "kept"), [(0.99, True), (0.5, True), (1.01, False), (9, False)])
def test_the_next_size_is_the_one_that_the_error_allows(order, error, kept):
    keep, start, end, _, rejected, result = _adapted(error, order=order)
    assert bool(keep) is kept
    assert bool(rejected) is not kept
    assert result == diffrax.RESULTS.successful
    assert float(start) == pytest.approx(0.5 + SPAN if kept else 0.5)
    assert float(end - start) == pytest.approx(SPAN * SAFETY * error ** (-1.0 / order), rel=1e-9)


def test_a_state_that_runs_away_is_not_kept_for_a_small_relative_error():
    """To itself its error is half a tolerance, which for any other state would be kept."""
    assert bool(_adapted(0.5, grown=1e3)[0])
    assert not bool(_adapted(0.5, grown=1e12)[0])


def test_sizes_change_by_limited_factors():
    for error, factor in ((1e-12, 10.0), (0.0, 10.0), (1e9, 0.2), (np.inf, 0.2), (np.nan, 0.2)):
        _, start, end, *_ = _adapted(error)
        assert float(end - start) == pytest.approx(factor * SPAN, rel=1e-9)


def test_no_step_is_larger_than_the_one_before_it_that_followed_a_rejection():
    _, start, end, *_ = _adapted(1e-6, rejected=True)
    assert float(end - start) == pytest.approx(SPAN, rel=1e-9)
    _, start, end, *_ = _adapted(0.9, rejected=True)
    assert float(end - start) < SPAN


@pytest.mark.parametrize("error", [1e3, np.nan])
def test_the_smallest_step_is_taken_whatever_its_error(error):
    keep, start, end, *_ = _adapted(error, span=SMALLEST_STEP, at=0.0)
    assert keep
    assert float(end - start) == pytest.approx(SMALLEST_STEP, abs=0.0)
    keep, start, end, *_ = _adapted(error, span=0.0, at=1e9)  # no time to be told apart
    assert keep
    assert end > start


@pytest.mark.parametrize("time", [None, 7.0])
def test_the_smallest_step_of_a_solve_with_derivatives_is_in_its_unit_of_time(time):
    """It is taken whatever its error; SI units are those of a solve without units."""
    control = step_control(
        RTOL, RTOL, rms_norm, None if time is None else UNITS._replace(time=time)
    )
    smallest, state = SMALLEST_STEP * (time or 1.0), jtu.tree_map(jnp.asarray, STATE)
    end, known = control.init(None, 0.0, 1.0, state, 2.0 * smallest, None, None, ORDER)
    for kept in (False, True):
        step = (state, state, None, jtu.tree_map(jnp.ones_like, state), ORDER, known)
        keep, begin, end, _, known, _ = control.adapt_step_size(jnp.asarray(0.0), end, *step)
        assert bool(keep) is kept
        assert float(end - begin) == pytest.approx(smallest, abs=0.0)


def test_tolerances_are_in_units_of_the_scene():
    walker = jb.Walker(m=1.0, J=0.0096 * 1e4, l=40.0, d=10.0, r=8.0)
    units = units_of(dataclasses.replace(jb.seed_scene(), walker=walker), STATE)
    control = ErrorControl(RTOL, 1e-2 * RTOL, units)
    pairs = list(zip(STATE, units.inverse, strict=True))
    for share, kept in ((0.9, True), (1.1, False)):
        error = jb.State(*(share * (1e-2 * RTOL / i + RTOL * abs(leaf)) for leaf, i in pairs))
        times = jnp.asarray(0.5), jnp.asarray(0.5 + SPAN)
        step = (STATE, STATE, None, error, ORDER, jnp.asarray(False))
        assert bool(control.adapt_step_size(*times, *step)[0]) is kept


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("wanted", [1e-3, 0.5, 0.9, 1.1, 30.0])
def test_step_size_is_that_of_the_root_mean_square(wanted, dtype):
    direction = np.random.default_rng(3).standard_normal(8) * np.logspace(-3, 2, 8)
    errors = wanted * direction / np.sqrt(np.mean(direction**2))
    kept, start, end, *_ = _adapted(errors, at=0.0, grown=1.1, dtype=dtype)
    assert bool(kept) is (wanted < 1.0)
    most = 10.0 if kept else 1.0
    expected = SPAN * np.clip(0.8 * wanted ** (-1.0 / ORDER), 0.2, most)
    rounding = 1e-12 if dtype is np.float64 else 1e-3
    np.testing.assert_allclose(end - start, expected, rtol=rounding)


@pytest.mark.parametrize("place", range(8))
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_rejected(place, bad):
    errors = np.zeros(8)
    errors[place] = bad
    kept, _, end, *_ = _adapted(errors, at=0.0)
    assert (bool(kept), float(end)) == (False, pytest.approx(0.2e-3))


def test_four_tolerances_share_a_division():
    def step(varying, invariant):
        control = ErrorControl(RTOL, 1e-2 * RTOL, invariant)
        y0, y1, error = varying
        one = jnp.ones(())
        return control.adapt_step_size(0.0 * one, one, y0, y1, None, error, ORDER, one > 2.0)[2]

    counts = count_operations(step, (STATE, STATE, STATE), UNITS)
    # And one by the root.
    assert counts["fdiv"] == 3

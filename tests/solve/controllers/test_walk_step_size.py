"""Error control, against its formula: which steps are kept, how large the next is."""

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler.runtime._program import count_operations
from jaxbiped.solve._units import units_of
from jaxbiped.solve.controllers._tangent_step_size import SAFETY, SMALLEST_STEP
from jaxbiped.solve.controllers._walk_step_size import ErrorControl

RTOL, SPAN = 1e-6, 1e-3
STATE = jb.seed_state()
UNITS = units_of(jb.seed_scene(), STATE)
ORDER = 4


def _adapted(error, *, rejected=False, span=SPAN, order=4, at=0.5, scene=None):
    """What becomes of a step all of whose errors are so many tolerances."""
    scene = jb.seed_scene() if scene is None else scene
    state = jb.seed_state()
    units = units_of(scene, state)
    control = ErrorControl(RTOL, 1e-2 * RTOL, units)
    errors = jb.State(
        *(
            error * (1e-2 * RTOL / inverse + RTOL * abs(leaf))
            for leaf, inverse in zip(state, units.inverse, strict=True)
        )
    )
    rest = (scene, errors, order, jnp.asarray(rejected))
    return control.adapt_step_size(jnp.asarray(at), jnp.asarray(at + span), state, state, *rest)


@pytest.mark.parametrize("order", [3, 4, 5])
@pytest.mark.parametrize(("error", "kept"), [(0.99, True), (0.5, True), (1.01, False), (9, False)])
def test_the_next_size_is_the_one_that_the_error_allows(order, error, kept):
    keep, start, end, _, rejected, result = _adapted(error, order=order)
    assert bool(keep) is kept
    assert bool(rejected) is not kept
    assert result == diffrax.RESULTS.successful
    assert float(start) == pytest.approx(0.5 + SPAN if kept else 0.5)
    assert float(end - start) == pytest.approx(SPAN * SAFETY * error ** (-1.0 / order), rel=1e-9)


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
    assert float(end - start) == pytest.approx(SMALLEST_STEP)
    keep, start, end, *_ = _adapted(error, span=0.0, at=1e9)  # no time to be told apart
    assert keep
    assert end > start


def test_tolerances_are_in_units_of_the_scene():
    large = jb.seed_scene()
    large = large.__class__(
        walker=jb.Walker(m=1.0, J=0.0096 * 1e4, l=40.0, d=10.0, r=8.0),
        ground=large.ground,
        normal=large.normal,
        friction=large.friction,
    )
    keep, *_ = _adapted(0.9, scene=large)
    assert keep
    keep, *_ = _adapted(1.1, scene=large)
    assert not keep


def _after(error, dtype=np.float64):
    units = jtu.tree_map(lambda unit: jnp.asarray(unit, dtype), UNITS)
    control = ErrorControl(RTOL, 1e-2 * RTOL, units)
    y0, y1, error = (
        jb.State(*(jnp.asarray(x, dtype) for x in each))
        for each in (STATE, [1.1 * float(x) for x in STATE], error)
    )
    zero, rejected = jnp.asarray(0.0, dtype), jnp.asarray(False)
    kept, _, end, *_ = control.adapt_step_size(
        zero, jnp.asarray(1e-3, dtype), y0, y1, None, error, ORDER, rejected
    )
    return bool(kept), float(end)


def _size(error):
    """Root mean square of the error in units of the tolerance."""
    inverse = np.array([float(x) for x in UNITS.inverse])
    largest = 1.1 * np.abs([float(x) for x in STATE])
    return np.sqrt(np.mean((np.asarray(error) / (1e-2 * RTOL / inverse + RTOL * largest)) ** 2))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("wanted", [1e-3, 0.5, 0.9, 1.1, 30.0])
def test_step_size_is_that_of_the_root_mean_square(wanted, dtype):
    direction = np.random.default_rng(3).standard_normal(8) * np.logspace(-3, 2, 8)
    error = direction * wanted / _size(direction)
    kept, end = _after(error, dtype)
    assert kept == (wanted < 1.0)
    size = end - 1e-3 if kept else end
    most = 10.0 if kept else 1.0
    expected = 1e-3 * np.clip(0.8 * wanted ** (-1.0 / ORDER), 0.2, most)
    np.testing.assert_allclose(size, expected, rtol=1e-12 if dtype is np.float64 else 1e-3)


@pytest.mark.parametrize("place", range(8))
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_rejected(place, bad):
    error = np.zeros(8)
    error[place] = bad
    assert _after(error) == (False, pytest.approx(0.2e-3))


def test_four_tolerances_share_a_division():
    def step(varying, invariant):
        control = ErrorControl(RTOL, 1e-2 * RTOL, invariant)
        y0, y1, error = varying
        one = jnp.ones(())
        return control.adapt_step_size(0.0 * one, one, y0, y1, None, error, ORDER, one > 2.0)[2]

    counts = count_operations(step, (STATE, STATE, STATE), UNITS)
    # And one by the root.
    assert counts["fdiv"] == 3

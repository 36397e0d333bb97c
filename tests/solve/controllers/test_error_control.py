"""Error control: which steps are kept, and how large the next one is."""

import diffrax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.solve._units import units_of
from jaxbiped.solve.controllers._error_control import ErrorControl
from jaxbiped.solve.controllers._step_control import SAFETY, SMALLEST_STEP

RTOL, SPAN = 1e-6, 1e-3


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

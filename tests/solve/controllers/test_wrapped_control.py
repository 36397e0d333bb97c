"""Wrapped step-size controllers, against what diffrax looks for in the innermost; the last step."""

import inspect

import diffrax
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.solve.controllers._event_steps import (
    FootstepLimit,
    LocatedEnding,
    ShallowContact,
    TouchdownAhead,
)
from jaxbiped.solve.controllers._step_size import CrossedSwitches, InUnits
from jaxbiped.solve.controllers._switch_locator import SwitchLocator
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractMemorylessControl,
    AbstractWrappedControl,
    Extremes,
    just_before_end,
)
from jaxbiped.solve.solvers import rms_norm
from jaxbiped.variational._solve_to_section import TangentControl

WALKING = jb.hybrid.Walking()
WRAPPERS = {
    Extremes: (lambda args, y: y,),
    FootstepLimit: (3, WALKING),
    InUnits: (1.0,),
    LocatedEnding: (WALKING, ("fall",)),
    CrossedSwitches: (WALKING, 10.0),
    ShallowContact: (WALKING,),
    SwitchLocator: (None,),
    TangentControl: (1e-5, jnp.ones(1)),
    TouchdownAhead: (WALKING,),
}


def _largest(error):
    return jnp.max(jnp.abs(error))


@pytest.mark.parametrize("kind", WRAPPERS)
def test_tolerances_and_norm_are_the_innermost_controllers(kind):
    inner = diffrax.PIDController(rtol=1e-3, atol=1e-6, norm=_largest)
    outer = FootstepLimit(kind(inner, *WRAPPERS[kind]), 1, WALKING)
    assert (outer.rtol, outer.atol, outer.norm) == (1e-3, 1e-6, _largest)
    assert outer.wrap(1) is outer


def test_steps_of_one_size_have_no_tolerances():
    outer = Extremes(FootstepLimit(diffrax.ConstantStepSize(), 1, WALKING), lambda args, y: y)
    assert (outer.rtol, outer.atol, outer.norm) == (0.0, 0.0, rms_norm)


@pytest.mark.parametrize("kind", WRAPPERS)
def test_no_wrapper_overrides_what_all_have_in_common(kind):
    (base,) = kind.__bases__
    assert base in (AbstractMemorylessControl, AbstractWrappedControl)
    shared = {name for name in dir(base) if not name.startswith("_")} - base.__abstractmethods__
    assert {"rtol", "atol", "norm", "wrap"} <= shared
    assert not shared & set(vars(kind))
    assert not inspect.isabstract(kind)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_almost_is_a_hundred_numbers_before(sign):
    ends = sign * np.concatenate([np.geomspace(1e-200, 1e200, 101), [0.0, 1.0, 1.0 + 1e-15, 2.0]])
    expected = jnp.asarray(ends)
    before = jax.jit(eqxi.prevbefore)
    for _ in range(100):
        expected = before(expected)
    np.testing.assert_array_equal(just_before_end(jnp.asarray(ends)), expected)


def test_almost_of_no_number_is_none_and_of_no_end_is_finite():
    assert np.isnan(just_before_end(jnp.asarray(np.nan)))
    assert np.isfinite(just_before_end(jnp.asarray(np.inf)))

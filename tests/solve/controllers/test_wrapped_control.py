"""Wrapped step-size controllers, against what diffrax looks for in the innermost."""

import inspect

import diffrax
import jax.numpy as jnp
import pytest

from jaxbiped.solve._accuracy import rms_norm
from jaxbiped.solve.controllers._contact_steps import ShallowContact, TouchdownAhead
from jaxbiped.solve.controllers._solve_ends import FootstepLimit, LocatedEnding
from jaxbiped.solve.controllers._step_size import CrossedSwitches, InUnits
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractMemorylessControl,
    AbstractWrappedControl,
    Extremes,
)
from jaxbiped.variational._switch_locator import SwitchLocator
from jaxbiped.variational._tangent_solver import TangentControl

WRAPPERS = {
    Extremes: (lambda args, y: y,),
    FootstepLimit: (3,),
    InUnits: (1.0,),
    LocatedEnding: (("fall",),),
    CrossedSwitches: (10.0,),
    ShallowContact: (),
    SwitchLocator: (None,),
    TangentControl: (1e-5, jnp.ones(1)),
    TouchdownAhead: (),
}


def _largest(error):
    return jnp.max(jnp.abs(error))


@pytest.mark.parametrize("kind", WRAPPERS)
def test_tolerances_and_norm_are_the_innermost_controllers(kind):
    inner = diffrax.PIDController(rtol=1e-3, atol=1e-6, norm=_largest)
    outer = FootstepLimit(kind(inner, *WRAPPERS[kind]), 1)
    assert (outer.rtol, outer.atol, outer.norm) == (1e-3, 1e-6, _largest)
    assert outer.wrap(1) is outer


def test_steps_of_one_size_have_no_tolerances():
    outer = Extremes(FootstepLimit(diffrax.ConstantStepSize(), 1), lambda args, y: y)
    assert (outer.rtol, outer.atol, outer.norm) == (0.0, 0.0, rms_norm)


@pytest.mark.parametrize("kind", WRAPPERS)
def test_no_wrapper_overrides_what_all_have_in_common(kind):
    (base,) = kind.__bases__
    assert base in (AbstractMemorylessControl, AbstractWrappedControl)
    shared = {name for name in dir(base) if not name.startswith("_")} - base.__abstractmethods__
    assert {"rtol", "atol", "norm", "wrap"} <= shared
    assert not shared & set(vars(kind))
    assert not inspect.isabstract(kind)

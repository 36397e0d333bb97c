"""Gait measures: all gradient modes, against each other."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb

pytestmark = pytest.mark.slow


def measured(log_changes, gradient):
    """Period and step length as functions of log K, log c and log l."""
    k, c, length = jnp.exp(log_changes)
    scene = jb.seed_scene(K=1e6 * k, c=1e7 * c, l=0.4 * length)
    measures = jb.gait_measures(scene, gradient=gradient)
    return jnp.stack([measures.period, measures.step_length])


@jax.jit
def implicitly(point):
    # Value and derivative of one solve, which compiles sooner than one for each.
    jacobian, value = jax.jacrev(lambda p: (measured(p, jb.Implicit()),) * 2, has_aux=True)(point)
    return value, jacobian


@jax.jit
def forwards(point, direction):
    return jax.jvp(lambda p: measured(p, jb.Forward()), (point,), (direction,))


@jax.jit
def in_reverse(point):
    return jax.jacrev(lambda p: measured(p, jb.Reverse()))(point)


@settings(max_examples=3, deadline=None)
@given(st.lists(st.floats(-0.03, 0.03, allow_subnormal=False), min_size=3, max_size=3))
def test_all_gradient_modes_agree_on_random_scenes(changes):
    point, direction = jnp.array(changes), jnp.array([1.0, -0.5, 0.2])
    value, jacobian = implicitly(point)
    again, slope = forwards(point, direction)
    assert np.asarray(again) == pytest.approx(np.asarray(value), abs=1e-5)
    assert np.asarray(slope) == pytest.approx(np.asarray(jacobian @ direction), rel=5e-4, abs=1e-6)
    assert np.asarray(in_reverse(point)) == pytest.approx(np.asarray(jacobian), rel=5e-4, abs=1e-6)


def test_gradient_must_be_a_mode():
    with pytest.raises(jb.ArgumentError, match="gradient"):
        jb.gait_measures(jb.seed_scene(), gradient="forward")


def test_second_derivatives_are_refused():
    rigid = jb.ladder()["rigid"]
    start = jb.dynamics.rigid_state(jb.seed_state())

    def period(slope):
        return jb.gait_measures(jb.with_parameters(rigid, {"slope": slope})).period

    def time(rate):
        return jb.return_map(rigid, start._replace(omega_1=rate)).time

    for function, at, said in (
        (period, 0.02, "Second derivatives of gait_measures"),
        (time, 1.5, "cannot be differentiated"),
    ):
        with pytest.raises(jb.ArgumentError, match=said):
            jax.hessian(function)(at)

"""Equations of motion against an independent program and a flight in closed form."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.compliant import derivative, numbers

import jaxbiped as jb

# XLA takes subnormal numbers for zero, and a law that asks for a sign then answers otherwise.
floats = partial(st.floats, allow_subnormal=False)
angle = floats(-1.0, 1.0)
speed = floats(-3.0, 3.0)


@settings(deadline=None, max_examples=60)
@given(
    st.tuples(floats(-1, 1), floats(0.3, 0.45), angle, angle, speed, speed, speed, speed),
    floats(0.0, 2.0),
    floats(-0.1, 0.2),
)
def test_vector_field_equals_the_independent_one(y, hip, slope):
    expected = derivative(0.0, np.array(y), numbers(hip_mass=hip, slope=slope))
    scene = jb.seed_scene(hip_mass=hip, slope=slope)
    got = jb.dynamics.vector_field(0.0, jb.State(*map(jnp.asarray, y)), scene)
    scale = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(np.array(got), expected, rtol=1e-9, atol=1e-11 * scale)


def test_free_flight():
    """The centre of mass flies a parabola; momenta of the fall and spin are kept."""
    scene = jb.seed_scene(slope=0.2, hip_mass=0.3)
    start = jb.State(*map(jnp.asarray, (0.0, 5.0, -0.5, 0.4, 1.0, 2.0, 3.0, -2.0)))
    flight = jb.simulate(scene, start, duration=0.8, accuracy="tight", watch=())
    walker, total = scene.walker, float(scene.walker.total_mass)

    def centre(s):
        md = walker.m * walker.d / total
        return (
            s.hip_x + md * (jnp.sin(s.theta_1) + jnp.sin(s.theta_2)),
            s.hip_z - md * (jnp.cos(s.theta_1) + jnp.cos(s.theta_2)),
        )

    rates = jax.jvp(
        lambda s: centre(s),
        (start,),
        (jb.dynamics.vector_field(0.0, start, scene),),
    )[1]
    t = flight.t
    x, z = centre(flight.state)
    gx, gz = 9.8 * np.sin(0.2), -9.8 * np.cos(0.2)
    np.testing.assert_allclose(x, centre(start)[0] + rates[0] * t + gx * t**2 / 2, atol=1e-8)
    np.testing.assert_allclose(z, centre(start)[1] + rates[1] * t + gz * t**2 / 2, atol=1e-8)
    held = jb.dynamics.energies(scene, flight.state)
    np.testing.assert_allclose(held.total, held.total[0], rtol=1e-8)

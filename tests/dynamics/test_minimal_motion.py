"""Equations of motion against an independent program and closed forms."""

from functools import partial

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.compliant import START, derivative, numbers
from scipy.special import ellipk

import jaxbiped as jb
from jaxbiped.dynamics._tree import Motion, pose_of
from jaxbiped.dynamics._tree_inertia import composites, eliminate

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


def test_vector_field_at_the_seed_start():
    expected = derivative(0.0, START, numbers())
    np.testing.assert_allclose(
        np.array(jb.dynamics.vector_field(0.0, jb.seed_state(), jb.seed_scene())),
        expected,
        rtol=1e-12,
    )


def test_field_works_on_a_time_series():
    states = jax.tree_util.tree_map(lambda leaf: jnp.full(3, leaf), jb.seed_state())
    rates = jb.dynamics.vector_field(0.0, states, jb.seed_scene())
    assert all(leaf.shape == (3,) for leaf in rates)


def test_a_leg_pinned_at_the_hip_is_a_pendulum():
    """Its period at a large amplitude is the complete elliptic integral."""
    scene = jb.seed_scene(slope=0.1)
    walker, amplitude = scene.walker, 0.9
    mechanism = walker.mechanism()
    known = composites(mechanism)

    def field(t, y, args):
        angle, rate = y
        none = jnp.zeros(())
        pose = pose_of(mechanism, Motion(none, none, none, none, (angle, angle), (rate, rate)))
        along, off = eliminate(mechanism.structure, known, pose).shares[0]
        # The falling frame sees the pin rise.
        slope, g = scene.ground.slope, scene.ground.g
        return rate, g * (along * jnp.sin(slope) - off * jnp.cos(slope))

    inertia = walker.J + walker.m * walker.d**2
    frequency = float(jnp.sqrt(walker.m * scene.ground.g * walker.d / inertia))
    period = 4.0 / frequency * ellipk(np.sin(amplitude / 2) ** 2)
    # It hangs along gravity: at the slope's angle from the slope's normal.
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        jb.solvers.Rodas5P(),
        0.0,
        3 * period,
        1e-3,
        (jnp.asarray(0.1 + amplitude), jnp.asarray(0.0)),
        stepsize_controller=diffrax.PIDController(rtol=1e-10, atol=1e-12),
        saveat=diffrax.SaveAt(ts=jnp.array([0.5, 1.0, 2.5, 3.0]) * period),
    )
    np.testing.assert_allclose(
        solution.ys[0], 0.1 + amplitude * np.array([-1, 1, -1, 1]), atol=1e-7
    )


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

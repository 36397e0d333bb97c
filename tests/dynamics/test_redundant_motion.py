"""Two legs in redundant coordinates, against Newton's law and the minimal formulation.

What holds for every mechanism is in `test_redundant_mechanisms`.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import host_jit

COUNT = 256


def scattered(count=COUNT):
    """States near walking, feet above and under the ground, batch shape (count,)."""
    generator = np.random.default_rng(0)
    low = jnp.asarray([-1.0, -2e-4, -0.3, -0.3, -0.6, -0.6, -2.0, -2.0])
    high = jnp.asarray([1.0, 6e-4, 0.3, 0.3, 0.6, 0.6, 2.0, 2.0])
    state = jb.State(*(low + (high - low) * jnp.asarray(generator.uniform(size=(count, 8)))).T)
    depth = state.hip_z
    return state._replace(hip_z=jb.dynamics.standing_height(jb.seed_scene(), state.theta_2, depth))


def largest_gap(found, expected):
    """Largest difference, in units of each state's largest acceleration or force."""
    ours, theirs = (jnp.stack(jax.tree.leaves(each)) for each in (found, expected))
    size = jnp.maximum(jnp.max(jnp.abs(theirs), axis=0), 1.0)
    return jnp.max(jnp.abs(ours - theirs) / size)


def test_a_penalty_gives_way_by_the_inverse_of_a():
    """Its share 1/(A s), s the inverse of a leg's mass, is below 1e-10 from A = 3e9 kg on."""
    scene, states = jb.seed_scene(), scattered()

    @host_jit()
    def gap(penalty):
        held = jb.RedundantScene(scene, jb.constraints.Penalty(A=penalty))
        motion = jb.dynamics.redundant_motion(held, jb.dynamics.redundant_state(held, states))
        expected = jb.dynamics.accelerations(scene, states), jb.dynamics.hip_force(scene, states)
        return largest_gap((motion.minimal, motion.hip_force), expected)

    shares = [float(gap(jnp.asarray(penalty))) for penalty in (1e5, 1e7, 3e9)]
    assert shares[0] == pytest.approx(100.0 * shares[1], rel=1e-3)
    assert shares[1] == pytest.approx(300.0 * shares[2], rel=1e-2)
    assert shares[2] < 1e-10


def test_the_hip_carries_what_newtons_law_leaves_open():
    """Both legs' momenta change by gravity, the ground and the hip alone."""
    scene = jb.RedundantScene(jb.seed_scene())
    state = jb.dynamics.redundant_state(scene, jb.seed_state())
    motion, forces = (
        jb.dynamics.redundant_motion(scene, state),
        jb.dynamics.foot_forces(scene, state),
    )
    weight = 9.8 * np.array([np.sin(0.02), -np.cos(0.02)])
    hip = np.array(motion.hip_force)
    for leg, sign, ground in ((0, 1.0, forces[0]), (1, -1.0, forces[1])):
        acceleration = np.array(motion.accelerations[3 * leg : 3 * leg + 2])
        reaction = np.array([ground.tangential, ground.normal])
        np.testing.assert_allclose(acceleration, weight + reaction + sign * hip, atol=1e-10)


def test_a_foot_feels_its_own_leg():
    """With the hip pulled open, leg 1's foot is where leg 1's coordinates put it."""
    scene = jb.RedundantScene(jb.seed_scene())
    start = jb.dynamics.redundant_state(scene, jb.seed_state())
    opened = start._replace(z_1=start.z_1 + 1e-3)
    before, after = jb.dynamics.feet(scene, start), jb.dynamics.feet(scene, opened)
    assert float(after[0].z - before[0].z) == pytest.approx(1e-3)
    assert float(after[1].z - before[1].z) == 0.0
    assert float(jb.dynamics.violation(scene, opened).position) == pytest.approx(1e-3)
    assert float(jb.dynamics.minimal_state(scene, opened).hip_z) == pytest.approx(0.395 + 5e-4)


def test_bristles_bend_as_in_minimal_coordinates():
    law = jb.laws.friction_law_like("lugre", mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0)
    scene = jb.Scene(*[getattr(jb.seed_scene(), n) for n in ("walker", "ground", "normal")], law)
    one = jnp.asarray(1e-6)
    state = jb.dynamics.BristleState(*jb.seed_state(), bristle_1=one, bristle_2=2.0 * one)
    redundant = jb.RedundantScene(scene)
    start = jb.dynamics.consistent_state(redundant, state).state
    rates = jb.dynamics.redundant_field(0.0, start, redundant)
    expected = jb.dynamics.vector_field(0.0, state, scene)
    assert float(rates.bristle_2) == pytest.approx(float(expected.bristle_2), rel=1e-12)
    assert float(rates.omega_2) == pytest.approx(float(expected.omega_2), rel=1e-9)

"""The redundant formulation against the minimal one on random consistent states."""

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


@pytest.mark.parametrize("hip_mass", [0.0, 0.7])
@pytest.mark.parametrize("orientation", ["angle", pytest.param("euler", marks=pytest.mark.slow)])
def test_accelerations_and_hip_force_are_the_minimal_ones(orientation, hip_mass):
    scene, states = jb.seed_scene(hip_mass=hip_mass), scattered()
    scenes = [
        jb.RedundantScene(scene, name, orientation) for name in jb.constraints.CONSTRAINT_METHODS
    ]

    @host_jit()
    def both(state):
        minimal = jb.dynamics.accelerations(scene, state), jb.dynamics.hip_force(scene, state)
        start = jb.dynamics.redundant_state(scenes[0], state)
        every = [jb.dynamics.redundant_motion(each, start) for each in scenes]
        return minimal, [(motion.minimal, motion.hip_force) for motion in every]

    expected, every = both(states)
    carrying = jb.dynamics.foot_forces(scene, states)[1].normal > 0.0
    assert 0.1 < float(jnp.mean(carrying.astype(float))) < 0.9
    for name, found in zip(jb.constraints.CONSTRAINT_METHODS, every, strict=True):
        assert float(largest_gap(found, expected)) < 1e-10, name


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


@pytest.mark.parametrize("orientation", ["angle", "euler"])
def test_energies_powers_and_feet_are_the_minimal_ones(orientation):
    scene, states = jb.seed_scene(hip_mass=0.4), scattered(16)
    redundant = jb.RedundantScene(scene, orientation=orientation)
    start = jb.dynamics.redundant_state(redundant, states)
    for function in (
        jb.dynamics.feet,
        jb.dynamics.energies,
        jb.dynamics.powers,
        jb.dynamics.foot_forces,
    ):
        found, expected = function(redundant, start), function(scene, states)
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
    for a, b in zip(jb.dynamics.minimal_state(redundant, start), states, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-14)
    off = jb.dynamics.violation(redundant, start)
    assert float(jnp.max(off.position)) < 1e-15
    assert float(jnp.max(off.rate)) < 1e-15


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

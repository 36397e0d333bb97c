"""Redundant coordinates of any mechanism against its minimal ones, and against the constraints."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import Body, Foot, Mechanism
from jaxbiped.compiler import host_jit
from tests.mechanisms import FEET, LAWS, LEGS, WALKERS, scene_of, start_of

WHEEL = Body("wheel", mass=1.0, inertia=0.5, centre=0.0)
QUICK = ("coupled", "five")
METHODS = tuple(jb.constraints.CONSTRAINT_METHODS)


def scattered(scene, name, count=8):
    """States near a walk's start, feet above and under the ground, shape (count,)."""
    generator, start = np.random.default_rng(1), start_of(name, scene)
    values = [float(leaf) + 0.3 * generator.uniform(-1.0, 1.0, count) for leaf in start]
    values[1] = float(start[1]) + generator.uniform(-0.02, 0.002, count)
    return type(start)(*map(jnp.asarray, values))


@pytest.mark.parametrize(
    ("name", "orientation"),
    [
        *(pytest.param(name, "angle", marks=() if name in QUICK else pytest.mark.slow)
          for name in WALKERS),
        *(pytest.param(name, "euler", marks=pytest.mark.slow if name == "coupled" else
                       pytest.mark.nightly) for name in WALKERS),
    ],
)  # fmt: skip
def test_accelerations_and_the_hinges_force_are_the_minimal_ones(name, orientation):
    scene = scene_of(name)
    states = scattered(scene, name)

    @host_jit()
    def every(state):
        expected = jb.dynamics.accelerations(scene, state), jb.dynamics.hip_force(scene, state)
        found = []
        for method in METHODS:
            held = jb.RedundantScene(scene, method, orientation)
            motion = jb.dynamics.redundant_motion(held, jb.dynamics.redundant_state(held, state))
            found.append((motion.minimal, motion.hip_force))
        return expected, found

    expected, found = every(states)
    expected = np.stack([*expected[0], *expected[1]])
    assert np.any(np.abs(expected[-1]) > 1.0)
    size = np.maximum(np.abs(expected).max(axis=0), 1.0)
    for method, (minimal, force) in zip(METHODS, found, strict=True):
        gap = np.abs(np.stack([*minimal, *force]) - expected) / size
        assert gap.max() < 1e-10, method


@pytest.mark.parametrize("name", ["coupled", "kneed"])
def test_every_parameter_moves_it_as_in_minimal_coordinates(name):
    """Along a random direction of all parameters at once, a mass's shift of mass centres too."""
    scene = scene_of(name)
    states = scattered(scene, name, 4)
    numbers, rest = eqx.partition(scene, eqx.is_inexact_array)
    generator = np.random.default_rng(2)
    along = jax.tree.map(lambda leaf: jnp.asarray(generator.uniform(-1.0, 1.0)) * leaf, numbers)

    def minimal(numbers):
        return jnp.stack(jb.dynamics.accelerations(eqx.combine(numbers, rest), states))

    def redundant(numbers):
        held = jb.RedundantScene(eqx.combine(numbers, rest))
        start = jb.dynamics.redundant_state(held, states)
        return jnp.stack(jb.dynamics.redundant_motion(held, start).minimal)

    expected, found = (
        host_jit()(lambda *given, f=f: jax.jvp(f, *map(tuple, zip(given)))[1])(numbers, along)
        for f in (minimal, redundant)
    )
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("orientation", ["angle", "euler"])
@pytest.mark.parametrize("name", ["coupled", "flat", "five"])
def test_states_go_both_ways(name, orientation):
    scene = scene_of(name)
    states = scattered(scene, name)
    held = jb.RedundantScene(scene, orientation=orientation)
    start = jb.dynamics.redundant_state(held, states)
    back = jb.dynamics.minimal_state(held, start)
    assert type(back) is type(states)
    np.testing.assert_allclose(np.stack(back), np.stack(states), atol=1e-14)
    for value in jb.dynamics.violation(held, start):
        assert float(np.max(value)) < 5e-15
    for function in (
        jb.dynamics.energies, jb.dynamics.powers, jb.dynamics.feet, jb.dynamics.foot_forces
    ):  # fmt: skip
        found, expected = function(held, start), function(scene, states)
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)


def test_what_hangs_alone_has_no_constraint():
    """A wheel on four feet: one body on the root point, whose hinge carries nothing."""
    feet = (Foot("wheel", centre=(np.cos(k), np.sin(k)), leg=f"spoke_{k}") for k in range(4))
    wheel = Mechanism(root="hub", bodies=(WHEEL,), feet=tuple(feet))
    scene = jb.Scene(walker=wheel, ground=jb.Ground(slope=0.05), **LAWS)
    state = scene.state(theta_wheel=0.3, omega_wheel=-1.0, hub_z=0.98)
    held = jb.RedundantScene(scene)
    assert not held.linkage.joints
    start = jb.dynamics.consistent_state(held, state).state
    motion = jb.dynamics.redundant_motion(held, jb.dynamics.project(held, start))
    np.testing.assert_allclose(motion.minimal, jb.dynamics.accelerations(scene, state))
    assert tuple(map(float, motion.hip_force)) == (0.0, 0.0)


def test_a_start_off_its_coupling_is_put_back_and_refused_far_off():
    held = jb.RedundantScene(scene_of("coupled"))
    start = jb.dynamics.redundant_state(held, start_of("coupled", held.scene))
    off = start._replace(theta_torso=start.theta_torso + 5e-3)
    found = jb.dynamics.consistent_state(held, off)
    assert float(found.violation.angle) == pytest.approx(5e-3)
    assert float(jb.dynamics.violation(held, found.state).angle) < 1e-15
    assert 0.0 < float(found.position) < 5e-4
    before, after = float(start.theta_torso), float(start.theta_torso) + 0.05
    far = dict(theta_torso=after, x_torso=start.x_torso - 0.1 * (np.sin(after) - np.sin(before)))
    far["z_torso"] = start.z_torso + 0.1 * (np.cos(after) - np.cos(before))
    with pytest.raises(jb.ArgumentError, match=r"rad \(angle\), which is too far"):
        jb.dynamics.consistent_state(held, start._replace(**far))
    with pytest.raises(jb.ArgumentError, match="those of this scene are hip_x, hip_z, theta_leg_1"):
        jb.dynamics.consistent_state(held, jb.seed_state())


@pytest.mark.parametrize("lacks", ["mass", "inertia"])
def test_a_body_that_cannot_move_by_itself_is_refused(lacks):
    """But for one to which the root point lends its mass."""
    body = Body("torso", **dict(mass=0.5, inertia=0.1, centre=-0.1) | {lacks: 0.0})
    scene = scene_of("torso", walker=Mechanism(bodies=(*LEGS, body), feet=FEET))
    with pytest.raises(jb.ArgumentError, match=rf"Body\('torso'\) has no {lacks}, .* redundant"):
        jb.RedundantScene(scene)
    loaded = Mechanism(root_mass=0.3, bodies=(*LEGS, body), feet=FEET)
    jb.RedundantScene(scene_of("torso", walker=loaded))

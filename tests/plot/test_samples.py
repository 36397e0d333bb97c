"""Samples of a walk for figures, against the walk between its steps."""

import jax.numpy as jnp
import numpy as np

import jaxbiped as jb
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.measure._samples import evaluate_along
from jaxbiped.plot._samples import sample, state_at


def test_samples_hold_every_step_of_the_solver(seed_walk):
    _, walk = seed_walk
    t, state = sample(walk)
    assert np.all(np.diff(t) > 0.0)
    steps = np.asarray(walk.t)
    assert np.isin(steps[1:-1], t).all()
    found = np.searchsorted(t, steps[1:-1])
    np.testing.assert_array_equal(state.omega_1[found], np.asarray(walk.state.omega_1)[1:-1])


def test_samples_between_two_times(seed_walk):
    _, walk = seed_walk
    t, state = sample(walk, start=0.5, stop=0.51)
    assert (t[0], t[-1]) == (0.5, 0.51)
    np.testing.assert_allclose(state.theta_2, np.asarray(walk.at(t).theta_2), rtol=1e-12)
    t, _ = sample(walk, start=-1.0, stop=9.0)
    assert (t[0], t[-1]) == (0.0, 2.0)


def test_contacts_are_feet_and_forces(seed_walk):
    scene, walk = seed_walk
    state = state_at(walk, np.linspace(0.0, 2.0, 11))
    found = evaluate_along(scene, state, contacts)
    forces = jb.dynamics.foot_forces(scene, jb.State(*(jnp.asarray(leaf) for leaf in state)))
    np.testing.assert_allclose(found.forces.foot_1.normal, np.asarray(forces.foot_1.normal))
    np.testing.assert_allclose(found.forces.foot_2.tangential, np.asarray(forces.foot_2.tangential))
    assert found.touching[0].shape == (11,)

"""Samples of a walk for figures, against the walk between its steps and far finer samplings."""

import equinox as eqx
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.measure._samples import evaluate_at
from jaxbiped.plot._contact_charts import sampled_forces
from jaxbiped.plot._samples import sample


def test_samples_between_two_times(seed_walk):
    _, walk = seed_walk
    t, state = sample(walk, start=0.5, stop=0.51)
    assert (t[0], t[-1]) == (0.5, 0.51)
    np.testing.assert_allclose(state.theta_2, np.asarray(walk.at(t).theta_2), rtol=1e-12)
    t, _ = sample(walk, start=-1.0, stop=9.0)
    assert (t[0], t[-1]) == (0.0, 2.0)


@pytest.fixture(scope="module")
def walk():
    """A walk at the accuracy that is usual, of eleven footsteps: scene and trajectory."""
    scene = jb.seed_scene()
    return scene, jb.simulate(scene, jb.seed_state(), duration=5.0)


def _peaks(scene, walk, t, found):
    """Largest normal and tangential force of each heel strike, of the foot that lands."""
    for time, foot in zip(*jb.measure.heel_strikes(scene, walk), strict=True):
        near = (t > time - 1e-4) & (t < time + 5e-3)
        normal, tangential = found[f"normal_{foot}"], found[f"tangential_{foot}"]
        yield foot, t[near], normal[near], -tangential[near]


def test_peaks_are_those_of_a_much_finer_sampling(walk):
    scene, trajectory = walk
    t, found = sampled_forces(scene, trajectory)
    assert np.all(np.diff(t) > 0.0)
    for foot, near, normal, tangential in _peaks(scene, trajectory, t, found):
        for drawn, name, sign in ((normal, "normal", 1.0), (tangential, "tangential", -1.0)):
            fine = near[np.argmax(drawn)] + np.linspace(-1e-6, 1e-6, 20_001)
            finest = getattr(evaluate_at(scene, trajectory, contacts, fine).forces[foot - 1], name)
            assert drawn.max() == pytest.approx(float(np.max(sign * finest)), rel=2e-5)


def test_peaks_do_not_vary_from_step_to_step(walk):
    scene, trajectory = walk
    peaks = [
        (normal.max(), tangential.max())
        for _, _, normal, tangential in _peaks(
            scene, trajectory, *sampled_forces(scene, trajectory)
        )
    ]
    settled = np.array(peaks[-3:])
    # The solver's own steps leave 1.8 % in the tangential ones.
    assert (np.ptp(settled, axis=0) < 1e-3 * settled.mean(axis=0)).all()


def test_between_two_times_and_without_friction(walk):
    scene, trajectory = walk
    slippery = eqx.tree_at(lambda s: s.friction, scene, jb.laws.Frictionless())
    t, found = sampled_forces(slippery, trajectory, start=0.3, stop=0.5)
    assert (t[0], t[-1]) == (0.3, 0.5)
    assert set(found) == {"normal_1", "normal_2"}
    assert found["normal_1"].shape == t.shape

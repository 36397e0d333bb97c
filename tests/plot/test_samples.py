"""Samples of a walk for figures, against the walk between its steps and far finer samplings."""

import dataclasses

import numpy as np
import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from tests.drawn import points_of


def drawn_forces(scene, walk, column=0):
    """Times of a column of the figure of forces, and the forces by their kinds and feet [N]."""
    axes = np.array(jb.plot.contact_forces(scene, walk, figure=Figure()).axes).reshape(-1, 2)
    forces = {}
    for kind, ax in zip(("normal", "tangential"), axes[:, column], strict=False):
        for foot, line in enumerate(points_of(ax)[:2], 1):
            t, forces[f"{kind}_{foot}"] = line.T
    return t, forces


def test_samples_begin_and_end_where_they_are_asked_for(seed_walk):
    scene, walk = seed_walk
    t, _ = drawn_forces(scene, walk)
    assert (t[0], t[-1]) == (0.0, 2.0)
    milliseconds, forces = drawn_forces(scene, walk, column=1)
    assert milliseconds[[0, -1]] == pytest.approx([-0.5, 4.5])
    strike = jb.measure.heel_strikes(scene, walk).time_s[-1]
    exact = jb.dynamics.foot_forces(scene, walk.at(strike + 1e-3 * milliseconds))
    for foot, force in enumerate(exact, 1):
        np.testing.assert_allclose(forces[f"normal_{foot}"], force.normal, rtol=1e-6, atol=1e-6)


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
    t, found = drawn_forces(scene, trajectory)
    assert np.all(np.diff(t) > 0.0)
    for foot, near, normal, tangential in _peaks(scene, trajectory, t, found):
        for drawn, name, sign in ((normal, "normal", 1.0), (tangential, "tangential", -1.0)):
            fine = near[np.argmax(drawn)] + np.linspace(-1e-6, 1e-6, 20_001)
            forces = jb.dynamics.foot_forces(scene, trajectory.at(fine))
            finest = sign * np.asarray(getattr(forces[foot - 1], name))
            assert drawn.max() == pytest.approx(finest.max(), rel=2e-5)


def test_peaks_do_not_vary_from_step_to_step(walk):
    scene, trajectory = walk
    peaks = [
        (normal.max(), tangential.max())
        for _, _, normal, tangential in _peaks(scene, trajectory, *drawn_forces(scene, trajectory))
    ]
    settled = np.array(peaks[-3:])
    # The solver's own steps leave 1.8 % in the tangential ones.
    assert (np.ptp(settled, axis=0) < 1e-3 * settled.mean(axis=0)).all()


def test_without_friction_there_is_no_tangential_force():
    slippery = dataclasses.replace(jb.seed_scene(), friction=jb.laws.Frictionless())
    walk = jb.simulate(slippery, jb.seed_state(), duration=0.2)
    (ax,) = jb.plot.contact_forces(slippery, walk).axes
    assert "normal" in ax.get_ylabel()

"""Starts about gaits of walkers whose knees lock, against plain walks and what stays held."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.models import hsu_chen

pytestmark = pytest.mark.nightly

FREE = ("thigh_1", "shank_1", "thigh_2")
"""Bodies that no stop holds at a heel strike."""


@pytest.fixture(scope="module")
def gait():
    return jb.find_gait(hsu_chen(), parameters=(), radius_sensitivities=False)


@pytest.fixture(scope="module")
def labelling(gait):
    return jb.labelling(hsu_chen(), guess=gait.measures.state)


def test_the_radius_of_certain_attraction_is_measured(labelling):
    assert labelling.family.rows[0][0].radius > 1e-4


def test_the_nearest_failure_keeps_what_is_held(labelling):
    found = jb.labels.nearest_failure(labelling, gradients=False, tolerance=1e-3)
    gait = labelling.family.rows[0][0]
    push = dict(zip(gait.state._fields[1:], found.push, strict=True))
    assert push["theta_thigh_2"] == pytest.approx(push["theta_shank_2"], abs=1e-12)
    assert push["mode"] == pytest.approx(0.0, abs=1e-12)
    assert push["theta_shank_1"] <= push["theta_thigh_1"] + 1e-6
    endings = [
        jb.rigid_walk(
            hsu_chen(), type(gait.state)(0.0, *(gait.point + share * found.push)), footsteps=30
        ).outcome
        for share in (0.95, 1.01)
    ]
    assert endings[0] is jb.Ending.WALKING
    assert endings[1] is not jb.Ending.WALKING


def test_starts_about_the_gait_come_back(labelling, gait):
    """Their held knee turns as its thigh does; those that a stop does not allow are no starts."""
    free = [f"{kind}_{body}" for kind in ("theta", "omega") for body in FREE]
    centres = {name: float(getattr(gait.measures.state, name)) for name in free}
    bounds = {name: (centre - 0.005, centre + 0.005) for name, centre in centres.items()}
    starts = jb.starts.sample(hsu_chen(), bounds, 200, seed=0, place=True)
    states = starts.at(labelling, np.arange(200)).states
    allowed = np.isfinite(np.stack(states)).all(axis=0)
    assert allowed.sum() > 50
    walks = labelling(states).label[allowed] == int(jb.basins.Label.WALKING)
    assert np.mean(walks) > 0.9


def test_a_wheel_that_is_too_slow_rolls_back():
    """The boundary is where its energy lifts the hub just over the top."""
    labelling = jb.labelling(jb.models.rimless_wheel())
    found = jb.labels.nearest_failure(labelling, gradients=False, tolerance=1e-4)
    theta, omega = found.boundary_point
    ahead = theta - 3.0 * np.pi / 8.0 + np.pi / 8.0 - 0.08
    assert 0.75 * omega**2 == pytest.approx(1.0 - np.cos(ahead), abs=1e-3)
    assert labelling.family.rows[0][0].radius > 1e-3

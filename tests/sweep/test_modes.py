"""Starts about gaits of walkers whose knees lock, against plain walks and what stays held."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.models import hsu_chen
from jaxbiped.optimise._certificate import _basin
from jaxbiped.sweep._follow_starts import passes_a_stop
from jaxbiped.variational._hybrid_system import admissible_directions, independent_names

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def gait():
    return jb.find_gait(hsu_chen(), parameters=(), radius_sensitivities=False)


@pytest.fixture(scope="module")
def labelling(gait):
    return jb.labelling(hsu_chen(), guess=gait.measures.state)


def test_directions_keep_the_knee_that_is_held(gait):
    state = gait.measures.state
    names, sizes = state._fields[1:], np.array([2.0, 1.0, 3.0, 1.0, 1.0, 1.0, 5.0, 1.0, 1.0])
    ways = sizes[:, None] * admissible_directions(hsu_chen(), state, sizes)
    assert ways.shape == (9, 6)
    of = dict(zip(names, ways, strict=True))
    for word in ("theta", "omega"):
        held = of[f"{word}_thigh_2"] - of[f"{word}_shank_2"]
        np.testing.assert_allclose(held, 0.0, atol=1e-12)
    np.testing.assert_allclose(of["mode"], 0.0, atol=1e-12)
    turning = ("thigh_1", "shank_1", "thigh_2")
    expected = tuple(f"{word}_{name}" for word in ("theta", "omega") for name in turning)
    assert independent_names(hsu_chen(), state) == expected


def test_starts_beyond_a_stop_are_told(gait):
    state = gait.measures.state
    moved = {name: np.full(3, float(x)) for name, x in state._asdict().items()}
    moved["theta_shank_1"] = moved["theta_shank_1"] + np.array([-0.01, 0.0, 0.01])
    np.testing.assert_array_equal(passes_a_stop(hsu_chen(), moved), [False, False, True])


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
    assert _basin(labelling, gait, 200, 0.005, 0).estimate > 0.9


def test_a_wheel_that_is_too_slow_rolls_back():
    """The boundary is where its energy lifts the hub just over the top."""
    labelling = jb.labelling(jb.models.rimless_wheel())
    found = jb.labels.nearest_failure(labelling, gradients=False, tolerance=1e-4)
    theta, omega = found.boundary_point
    ahead = theta - 3.0 * np.pi / 8.0 + np.pi / 8.0 - 0.08
    assert 0.75 * omega**2 == pytest.approx(1.0 - np.cos(ahead), abs=1e-3)
    assert labelling.family.rows[0][0].radius > 1e-3

"""The smallest fatal push off a gait, against labels as a function of coordinates."""

import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def labelling():
    seed = jb.seed_scene()
    return jb.labelling(jb.RigidScene(seed.walker, seed.ground), accuracy="balanced")


@pytest.fixture(scope="module")
def found(labelling):
    return {way: jb.labels.nearest_failure(labelling, gradients=way) for way in (False, True)}


def _fails(labelling, points):
    """By a plain walk of thirty footsteps, without any labelling."""
    walks = [
        jb.rigid_walk(
            labelling.scene, jb.dynamics.RigidState(0.0, *point), footsteps=30, accuracy="balanced"
        )
        for point in points
    ]
    return [walk.outcome is not jb.Ending.WALKING for walk in walks]


def test_the_push_is_fatal_and_less_is_not(labelling, found):
    gait = labelling.family.rows[0][0]
    push = found[True].push
    assert _fails(labelling, [gait.point + share * push for share in (1.001, 0.99)]) == [
        True,
        False,
    ]


def test_gradients_and_differences_lead_to_the_same_place(found):
    assert found[True].distance == pytest.approx(found[False].distance, rel=1e-3)
    assert found[True].angle < 0.01
    assert found[True].distance < found[True].bisected_distance
    assert found[True].asked < found[False].asked


def test_no_shorter_push_in_a_random_direction_is_fatal(labelling, found):
    gait, scales = labelling.family.rows[0][0], labelling.family.scales[0]
    random = np.random.default_rng(1).standard_normal((2000, 4))
    random *= 0.97 * found[True].distance / np.linalg.norm(random, axis=1, keepdims=True)
    states = jb.dynamics.RigidState(np.zeros(2000), *(gait.point + random * scales).T)
    assert (labelling(states).label == jb.basins.Label.WALKING).all()


def test_labels_at_points(labelling):
    gait = labelling.family.rows[0][0]
    names = ("omega_stance", "theta_swing")
    here = np.array([[gait.state.omega_2, gait.state.theta_1], [0.0, gait.state.theta_1]])
    codes = jb.labels.label_at(labelling, names)(here)
    assert list(codes) == [jb.basins.Label.WALKING, jb.basins.Label.FELL_BACK]
    assert list(jb.labels.label_at(labelling, names, failing=True)(here)) == [0, 1]
    with pytest.raises(jb.ArgumentError, match=r"points has shape \(2, 1\)"):
        jb.labels.label_at(labelling, names)(here[:, :1])
    with pytest.raises(jb.ArgumentError, match="'knee' is not known"):
        jb.labels.label_at(labelling, ("knee",))


def test_without_a_gait_there_is_nothing_to_push_off(labelling):
    family = labelling.family._replace(rows=((),))
    with pytest.raises(jb.ArgumentError, match="no stable gait"):
        jb.labels.nearest_failure(jb.labels.Labelling(labelling.scene, family, labelling.effort))

"""Attractors, families of gaits and settings, against closed forms, without a solve."""

import json
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins import Label
from jaxbiped.sweep import _nearest_failure
from jaxbiped.sweep._attractor import attractor_without_radius, component_scales
from jaxbiped.sweep._labelling_preparation import effort_of
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import as_kind, gaitless, with_attractor

SCENE = simplest_walker(0.009)
LABELLING = gaitless(SCENE, simplest_state(*STABLE))


@pytest.mark.parametrize("length", [0.4, 1.6])
def test_components_are_scaled_by_leg_length_and_gravity(length):
    scene = jb.with_parameters(jb.seed_scene(), {"l": length, "d": 0.05})
    state = jb.seed_state()._replace(hip_z=(length - 0.08) * np.cos(0.1655) + 0.08 - 3e-4)
    scales = dict(zip(jb.State._fields[1:], component_scales(scene, state), strict=True))
    speed, rate = np.sqrt(9.8 * length), np.sqrt(9.8 / length)
    assert scales["hip_z"] == pytest.approx(3e-4)
    assert [scales["hip_vx"], scales["hip_vz"]] == pytest.approx([speed, speed])
    assert [scales["omega_1"], scales["omega_2"]] == pytest.approx([rate, rate])
    assert [scales["theta_1"], scales["theta_2"]] == [1.0, 1.0]


def test_a_gait_draws_nearer_in_its_metric_by_its_contraction():
    """|W A e| ≤ q |W e| for every direction of the section."""
    jacobian = np.zeros((6, 4))
    jacobian[:4] = [[0.3, 0.0, 0.9, 0.1], [0.0, 0.3, 0.0, 0.0], [0.0, 0.2, 0.4, 0.3],
                    [0.5, 0.0, 0.0, 0.6]]  # fmt: skip
    jacobian[0] = -jacobian[1]  # onto the section, where the angles are opposite
    radius = np.abs(np.linalg.eigvals(jacobian[:4])).max()
    gait = SimpleNamespace(
        ending=0, stable=True, return_jacobian=jacobian, multipliers=np.zeros(3),
        measures=SimpleNamespace(
            state=jb.dynamics.RigidState(0.0, -0.2, 0.2, -0.1, -0.2), spectral_radius=radius,
            period=3.0, step_length=0.4,
        ),
        cycle_footsteps=1, orbit=(None, jb.dynamics.RigidState(*[np.zeros((1, 2))] * 5)),
    )  # fmt: skip
    found = attractor_without_radius(SCENE, gait)
    q = 0.5 * (1.0 + radius)
    assert found.contraction == pytest.approx(q)
    random = np.random.default_rng(1)
    for _ in range(20):
        e = random.standard_normal(4)
        e[0] = -e[1]
        image = found.metric @ jacobian[:4] @ e
        assert np.linalg.norm(image) <= q * np.linalg.norm(found.metric @ e) * (1.0 + 1e-9)
    assert found.distance(found.point[None]) == 0.0


def test_recurrences_are_looked_for_above_the_tolerance():
    assert [effort_of(SCENE, rtol=rtol).gap for rtol in (1e-9, 1e-4)] == pytest.approx([1e-4, 3e-4])
    effort = effort_of(SCENE, rtol=1e-9)._replace(rtol=1e-3)
    assert effort.gap == pytest.approx(3e-3)


ALONG = np.array([0.0, 0.6, 0.0, 0.8])


class BeyondAPlane(jb.labels.Labelling):
    """Pushes along one direction by more than a half fail, with a label for each side."""

    def __call__(self, states, *, parameters=None):
        gait, scales = self.family.rows[0][0], self.family.scales[0]
        pushes = (np.stack(states[1:], axis=1) - gait.point) / scales
        failures = np.array([int(Label.STUMBLED), int(Label.UNRESOLVED), 1, 9])
        sides = (pushes[:, 1] * 0.8 > pushes[:, 3] * 0.6) + 2 * (pushes[:, 0] > 0.0)
        label = np.where(pushes @ ALONG > 0.5, failures[sides], int(Label.WALKING))
        return SimpleNamespace(label=label)


def test_every_label_but_walking_is_a_failure():
    knows = as_kind(BeyondAPlane, with_attractor(LABELLING))
    found = jb.labels.nearest_failure(knows, gradients=False, max_distance=0.7, tolerance=1e-6)
    point, scales = knows.family.rows[0][0].point, knows.family.scales[0]
    assert found.distance == pytest.approx(0.5, abs=1e-5)
    np.testing.assert_allclose(found.push / scales, 0.5 * ALONG, atol=1e-3)
    on = (found.boundary_point - point) / scales
    assert on @ ALONG == pytest.approx(0.5, abs=1e-5)
    near = jb.labels.nearest_failure(knows, gradients=False, max_distance=0.4)
    assert np.isinf(near.distance)


def test_starts_of_other_parameters_have_no_gait_to_come_to():
    family = with_attractor(LABELLING).family
    own, cycles = family.goals({}, 2)
    assert (own.radii.tolist(), cycles) == ([[1e-2], [1e-2]], (1,))
    other, _ = family.goals({"slope": np.array([0.01, 0.02])}, 2)
    assert np.isneginf(other.radii).all()


def test_settings_tell_scene_family_and_effort():
    settings = json.loads(json.dumps(with_attractor(LABELLING).settings()))
    (gait,) = settings["gaits"][0]["gaits"]
    assert (gait["cycle_footsteps"], gait["radius"]) == (1, 1e-2)
    assert settings["scene"]["slope"] == pytest.approx(float(jnp.asarray(0.009)))


def test_the_normal_is_the_gradient_of_the_distance_after_the_footsteps_that_are_left():
    """A linear map: |W (Aᵏ e)|² / 2 has the gradient (Aᵏ)ᵀ Wᵀ W Aᵏ e; without a footstep none."""
    random = np.random.default_rng(3)
    slopes = 0.5 * random.standard_normal((4, 4))
    knows = with_attractor(LABELLING).family.rows[0][0]
    fails = np.array([[0, 0, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0], [4, 0, 0, 0, 0, 0]])
    counts = []

    def arrivals(points):
        off = points - knows.point
        changes, codes = np.tile(slopes, (len(off), 1, 1)), np.zeros(len(off), dtype=int)
        codes[:3] = fails[:, min(len(counts), 5)]
        counts.append(1)
        return changes, (knows.point + off @ slopes.T, codes)

    normal = _nearest_failure._normal_by(arrivals, knows)
    starts = knows.point + 0.01 * random.standard_normal((3, 4))
    found = normal(starts)
    for row, steps in ((0, len(counts)), (1, 2)):
        power = np.linalg.matrix_power(slopes, steps)
        squared = power.T @ knows.metric.T @ knows.metric @ power
        np.testing.assert_allclose(found[row], squared @ (starts - knows.point)[row], rtol=1e-10)
    assert np.isnan(found[2]).all()
    assert normal(np.zeros((0, 4))).shape == (0, 4)

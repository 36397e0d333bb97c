"""A gait whose contact force jumps at touchdown, against differences of gaits."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow

LAW = jb.laws.normal_law_like("kelvin-voigt", K=1e6, c=1e7, n=1.5, mass=2.0)
SCENE = dataclasses.replace(jb.seed_scene(), normal=LAW)
STEPS = {"K": 100.0, "D": 10.0, "slope": 1e-4}


@pytest.fixture(scope="module")
def gait():
    return jb.find_gait(SCENE, accuracy="tight", parameters=tuple(STEPS))


def test_the_gait_is_found_and_its_trivial_multiplier_is_one(gait):
    assert gait.outcome is jb.gait.Search.FOUND
    assert bool(gait.stable)
    assert float(gait.unit_multiplier_error) < 1e-4
    # Where a walk from the seed's start settles.
    assert float(gait.measures.period) == pytest.approx(0.44028, abs=1e-5)
    assert float(gait.measures.step_length) == pytest.approx(0.17971, abs=1e-5)


@pytest.mark.parametrize("name", STEPS)
def test_sensitivities_equal_differences(gait, name):
    step, k = STEPS[name], gait.parameters.index(name)
    middle = float((SCENE.normal.K, SCENE.normal.D, SCENE.ground.slope)[list(STEPS).index(name)])

    def measures(value):
        moved = jb.with_parameters(SCENE, {name: value})
        found = jb.find_gait(
            moved, gait.measures.state, accuracy="tight", parameters=(), radius_sensitivities=False
        )
        assert found.outcome is jb.gait.Search.FOUND
        return np.array([float(found.measures.period), float(found.measures.step_length)])

    expected = (measures(middle + step) - measures(middle - step)) / (2.0 * step)
    slopes = gait.sensitivities
    ours = [float(slopes.period[k]), float(slopes.step_length[k])]
    assert ours == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    "law", ["kelvin-voigt", "kuwabara-kono", pytest.param("tsuji", marks=pytest.mark.nightly)]
)
def test_sensitivities_of_the_radius_are_differences_of_gaits(law):
    """Also where the force is infinitely steep at touchdown."""
    normal = jb.laws.normal_law_like(law, K=1e6, c=1e7, n=1.5, mass=2.0)
    scene = dataclasses.replace(SCENE, normal=normal)
    gait = jb.find_gait(scene, parameters=("slope", "m", "mu_kinetic"))

    def radius(name, value):
        moved = jb.with_parameters(scene, {name: value})
        how = dict(accuracy="tight", parameters=())
        return float(jb.find_gait(moved, gait.measures.state, **how).measures.spectral_radius)

    values = 0.02, 1.0, float(scene.friction.mu_kinetic)
    slopes, errors = (
        each.spectral_radius for each in (gait.sensitivities, gait.sensitivity_errors)
    )
    for name, value, slope, error in zip(gait.parameters, values, slopes, errors, strict=True):
        h = 1e-3 * value
        expected = (radius(name, value + h) - radius(name, value - h)) / (2.0 * h)
        assert abs(float(slope) - expected) <= float(error) + 1e-4 * abs(expected)
        assert float(error) <= 0.1 * abs(expected)


def test_what_lies_right_behind_the_jump_is_not_a_number(gait):
    assert np.all(np.isnan(gait.sensitivities.peak_normal))
    assert np.all(np.isfinite(gait.sensitivities.spectral_radius))
    assert np.isfinite(float(gait.measures.peak_normal))

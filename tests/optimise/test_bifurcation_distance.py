"""Distances to folds and doublings: derivatives against central differences, error bars."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.optimise import Sought
from tests.optimise.evaluations import evaluated

pytestmark = pytest.mark.slow
STEP = 2e-3


def gait_of(scene, guess=None):
    return jb.find_gait(scene, guess, parameters=(), radius_sensitivities=False, engine="lanes")


@pytest.mark.parametrize(
    ("which", "kind", "varied"),
    [
        pytest.param("stribeck", "fold", ("r", "J", "d"), marks=pytest.mark.nightly),
        ("rigid", "period-doubling", ("r", "J", "d")),
        pytest.param("bristles", "fold", ("J",), marks=pytest.mark.nightly),
    ],
)
def test_derivatives_are_those_of_central_differences(which, kind, varied):
    """Of the bifurcation's slope, by tight solves."""
    scene = jb.ladder()[which]
    gait, names = gait_of(scene), jb.parameter_names(scene)
    told = jb.optimise.bifurcation_distance(scene, gait, kind)
    own_slope = float(scene.ground.slope)
    assert told.outcome is Sought.MET
    assert told.distance == pytest.approx(abs(told.value - own_slope))
    way = np.sign(told.value - own_slope)
    assert told.slopes[names.index("slope")] == -way
    assert told.value_slopes[names.index("slope")] == 0.0
    for name in varied:
        own, place = float(jb.parameter_values(scene)[name]), names.index(name)
        ends = []
        for sign in (1.0, -1.0):
            other = jb.with_parameters(scene, {name: own * (1.0 + sign * STEP)})
            near = gait_of(other, gait.measures.state)
            found = jb.optimise.bifurcation_distance(other, near, kind, accuracy="tight")
            ends.append(found.value)
        size = own / told.value
        quotient = (ends[0] - ends[1]) / (2.0 * STEP * own)
        off = abs(told.value_slopes[place] - quotient) * size
        assert off <= 1e-4 + told.slope_errors[place] * size, name
        assert told.slopes[place] == pytest.approx(way * told.value_slopes[place])


@pytest.mark.nightly
def test_the_bifurcations_are_those_of_the_branch():
    scene = jb.ladder()["stribeck"]
    branch = jb.continue_gait(scene, "slope", bounds=(0.0025, 0.16))
    # The branch's own multiplier has an error of 1e-5 at its doubling.
    for kind, apart in (("fold", 1e-6), ("period-doubling", 5e-6)):
        found = jb.optimise.bifurcation_distance(scene, gait_of(scene), kind)
        values = [each.value for each in branch.bifurcations if each.kind == kind]
        assert min(abs(value - found.value) for value in values) < apart
        assert 0.0 < found.error < 1e-5


def test_a_walker_without_a_fold_is_told():
    scene = jb.ladder()["rigid"]
    gait, own = gait_of(scene), float(scene.ground.slope)
    found = jb.optimise.bifurcation_distance(scene, gait)
    assert found.outcome is Sought.NONE_IN_RANGE
    assert found.bounds == pytest.approx((own / 8.0, own * 8.0))
    assert found.distance == pytest.approx(7.0 * own)
    assert np.isnan(found.value)
    assert np.all(np.isnan(found.slopes))
    assert jb.optimise.bifurcation_distance(scene, gait, "period-doubling").outcome is Sought.MET


def test_an_evaluation_tells_what_lies_beyond_the_range():
    scene = jb.ladder()["rigid"]
    gait = jb.find_gait(scene, radius_sensitivities=False, engine="lanes")
    names = ("fold_distance", "doubling_distance")
    known = evaluated(scene, gait, names)
    assert known.beyond_range == ("fold_distance",)
    assert known.values["fold_distance"] > known.values["doubling_distance"]
    assert not np.any(known.slopes["fold_distance"])
    assert np.any(known.slopes["doubling_distance"])


def test_what_is_not_allowed_is_refused_in_a_sentence():
    scene = jb.ladder()["rigid"]
    gait = gait_of(scene)
    with pytest.raises(jb.ArgumentError, match="kind = 'limit'"):
        jb.optimise.bifurcation_distance(scene, gait, "limit")
    with pytest.raises(jb.ArgumentError, match="along = 'beauty'"):
        jb.optimise.bifurcation_distance(scene, gait, along="beauty")
    with pytest.raises(jb.ArgumentError, match="hip_mass is 0"):
        jb.optimise.bifurcation_distance(scene, gait, along="hip_mass")

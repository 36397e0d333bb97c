"""Critical values against those of whole branches, and against differences of ones located anew."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.continuation import BranchEvent, bifurcation_sensitivities
from tests.compiler.one_shot import count_runs

pytestmark = pytest.mark.slow

RIGID = jb.ladder()["rigid"]


@pytest.fixture(scope="module")
def gait():
    return jb.find_gait(RIGID, parameters=(), radius_sensitivities=False)


def test_it_is_that_of_the_whole_branch(gait):
    found = jb.continuation.nearest_bifurcation(RIGID, gait)
    branch = jb.continue_gait(RIGID, "slope", bounds=(0.01, 0.11))
    (doubling,) = branch.bifurcations
    assert found.kind is BranchEvent.PERIOD_DOUBLING
    assert found.value == pytest.approx(doubling.value, rel=1e-7)
    assert found.ratio == pytest.approx(doubling.value / float(RIGID.ground.slope))


def test_it_follows_each_side_to_its_first_event_alone(gait, monkeypatch):
    """Far fewer cycles than a branch that goes on beyond them."""
    runs, own = count_runs(monkeypatch), float(RIGID.ground.slope)
    found = jb.continuation.nearest_bifurcation(RIGID, gait, factor=12.0)
    few = len(runs)
    branch = jb.continue_gait(RIGID, "slope", bounds=(own / 12.0, own * 12.0), guess=gait)
    assert found.value in [each.value for each in branch.bifurcations]
    assert 0 < few < 0.8 * (len(runs) - few)


def test_level_ground_is_left_to_both_sides():
    """A driven gait's slope has no factor to go by: the first of both ways by its distance.

    Downhill its branch folds, and ends on the sheet beyond, next to level ground: where footsteps
    are 1 % of the walker's height.
    """
    push = jb.actuation.PushOff(0.1)
    level = jb.with_parameters(jb.RigidScene(RIGID.walker, RIGID.ground, push), {"slope": 0.0})
    gait = jb.find_gait(level, parameters=(), radius_sensitivities=False)
    found = jb.continuation.nearest_bifurcation(level, gait)
    seen = jb.continue_gait(level, "slope", bounds=(-0.1, 0.1), guess=gait).bifurcations
    limit, fold, doubling = seen
    assert abs(limit.value) < 1e-3 < abs(fold.value) < doubling.value
    assert limit.point.step_length == pytest.approx(0.01 * float(RIGID.mechanism.height), rel=1e-3)
    assert found.kind is BranchEvent.FOLD
    assert found.value == pytest.approx(fold.value, rel=1e-7)
    assert found.ratio != found.ratio


def test_there_may_be_none(gait):
    found = jb.continuation.nearest_bifurcation(RIGID, gait, factor=1.2)
    assert found.kind is None
    assert found.value != found.value


def test_a_parameter_that_is_zero_is_refused(gait):
    with pytest.raises(jb.ArgumentError, match="hip_mass is 0"):
        jb.continuation.nearest_bifurcation(RIGID, gait, "hip_mass")
    with pytest.raises(jb.ArgumentError, match="factor = 1"):
        jb.continuation.nearest_bifurcation(RIGID, gait, factor=1)


def _followed(scene, kind, bounds):
    branch = jb.continue_gait(scene, bounds=bounds, accuracy="tight", max_points=40)
    (found,) = [each for each in branch.bifurcations if each.kind is kind]
    return branch, found


@pytest.mark.parametrize(
    ("scene", "kind", "bounds", "names"),
    [
        pytest.param(
            jb.seed_scene(slope=0.0105),
            BranchEvent.FOLD,
            (0.009, 0.0108),
            ("r", "K", "mu_kinetic"),
            marks=pytest.mark.nightly,
        ),
        (
            jb.with_parameters(RIGID, {"slope": 0.098}),
            BranchEvent.PERIOD_DOUBLING,
            (0.095, 0.105),
            ("J",),
        ),
    ],
    ids=["fold", "doubling"],
)
def test_slopes_are_differences_of_located_bifurcations(scene, kind, bounds, names):
    found = bifurcation_sensitivities(*_followed(scene, kind, bounds), names)
    assert found.along == "slope"
    assert found.parameters == names
    for name, slope, error in zip(names, found.slopes, found.errors, strict=True):
        value = float(jb.parameter_values(scene)[name])
        ends = [
            _followed(jb.with_parameters(scene, {name: value * factor}), kind, bounds)[1].value
            for factor in (1.001, 0.999)
        ]
        assert slope == pytest.approx((ends[0] - ends[1]) / (0.002 * value), rel=1e-5), name
        assert error < 1e-5 * abs(slope)
    values = np.array([float(jb.parameter_values(scene)[name]) for name in names])
    assert found.elasticities == pytest.approx(found.slopes * values / found.value)


def test_what_is_not_allowed_is_one_sentence():
    branch, doubling = _followed(
        jb.with_parameters(RIGID, {"slope": 0.098}), BranchEvent.PERIOD_DOUBLING, (0.095, 0.105)
    )
    limit = doubling._replace(kind=BranchEvent.LIMIT)
    for bifurcation, options, said in (
        (limit, {}, "limit has no derivative"),
        (doubling, {"accuracy": "best"}, "accuracy = 'best'"),
        (doubling, {"parameters": ("K",)}, "parameters = 'K'"),
    ):
        with pytest.raises(jb.ArgumentError, match=said) as refused:
            bifurcation_sensitivities(branch, bifurcation, **options)
        assert str(refused.value).endswith(".")
    # A gait far from any bifurcation is none.
    elsewhere = doubling._replace(point=branch.points[0])
    with pytest.raises(jb.ArgumentError, match="not the gait's largest"):
        bifurcation_sensitivities(branch, elsewhere, ("r", "J", "d"))

"""Sensitivities of a fold and of a doubling, against differences of bifurcations located anew."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.continuation import BranchEvent, bifurcation_sensitivities

pytestmark = pytest.mark.slow

RIGID = jb.ladder()["rigid"]


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

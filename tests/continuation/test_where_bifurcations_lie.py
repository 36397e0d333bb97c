"""The nearest bifurcation and the distance to it, against numbers written down."""

from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.continuation import BranchEvent
from jaxbiped.continuation import _critical_values as nearest
from jaxbiped.gait import BranchEnd
from jaxbiped.optimise import Sought
from jaxbiped.optimise import _bifurcation_distance as distances

SCENE = jb.ladder()["rigid"]
NAMES = jb.parameter_names(SCENE)
OWN = float(jb.parameter_values(SCENE)["slope"])


def event(value, kind=BranchEvent.FOLD):
    point = SimpleNamespace(value=value, place=np.array([value]), recurring=np.zeros(1))
    told = dict(multiplier=1.0 + 0j, error=0.01, beyond=np.nan)
    return SimpleNamespace(value=value, kind=kind, point=point, **told)


def branches(*parts, **how):
    """Branches through a gait: events to both sides, in their order away from it."""
    return [SimpleNamespace(bifurcations=events, **how) for events in parts]


@pytest.mark.parametrize(
    ("slope", "before", "after", "first"),
    [(0.02, 0.005, 0.05, 0.05), (0.02, 0.01, 0.05, 0.01), (0.0, -0.01, 0.005, 0.005)],
)
def test_the_nearest_is_that_of_the_smallest_factor(slope, before, after, first):
    found = nearest.nearest_of("slope", slope, branches([event(before)], [event(after)]))
    assert found.value == first
    assert (found.along, found.kind, found.error) == ("slope", BranchEvent.FOLD, 0.01)
    ratio = first / slope if slope else np.nan
    assert found.ratio == pytest.approx(ratio, nan_ok=True)


def test_what_lies_beyond_a_fold_is_another_gaits():
    """The branch turns back at 0.05, and doubles near the gait's own value, but not that gait."""
    doubling = event(0.021, BranchEvent.PERIOD_DOUBLING)
    parts = branches([event(0.004)], [event(0.05), doubling])
    found = nearest.nearest_of("slope", 0.02, parts)
    assert (found.kind, found.value) == (BranchEvent.FOLD, 0.05)


def test_where_one_was_not_located_the_nearer_end_counts():
    later = event(0.08, BranchEvent.NOT_LOCATED)
    later.beyond = 0.025
    parts = branches([event(0.01)], [later])
    assert nearest.nearest_of("slope", 0.02, parts).kind is BranchEvent.NOT_LOCATED


def test_a_range_ends_where_the_walker_allows_no_more():
    """A foot's radius at the leg's length, a leg at the radius, an exponent at one, a wall."""
    seed, own = jb.seed_scene(), jb.parameter_values(SCENE)
    d, r, leg = (float(own[name]) for name in "drl")
    assert nearest.range_of(SCENE, "d") == (d / 8.0, 8.0 * d)
    assert nearest.range_of(SCENE, "r") == (r / 8.0, pytest.approx(leg, rel=1e-9))
    assert nearest.range_of(SCENE, "l") == (pytest.approx(r, rel=1e-9), 8.0 * leg)
    assert nearest.farthest_allowed(seed, "n", 0.2) == pytest.approx(1.0, rel=1e-9)
    steep = nearest.range_of(jb.seed_scene(slope=0.3), "slope")[1]
    assert steep == pytest.approx(np.pi / 2, rel=1e-8)
    for name in ("r", "l", "n"):
        for end in nearest.range_of(seed, name):
            jb.with_parameters(seed, {name: end})
    assert nearest.range_of(jb.with_parameters(SCENE, {"slope": 0.0}), "slope") == (-0.1, 0.1)
    with pytest.raises(jb.ArgumentError, match="no factor fits"):
        nearest.range_of(SCENE, "hip_mass")


@pytest.mark.parametrize("value", [OWN + 0.01, OWN - 0.004])
def test_a_distance_moves_with_the_bifurcation_and_against_the_gait(value):
    slopes = np.arange(len(NAMES)) * 0.1
    slopes[NAMES.index("slope")] = 0.0
    located = distances.Functional(value, 1e-6, slopes, 0.01 * slopes)
    parts, asked = branches([event(OWN + 0.02)], [event(value)], stop=None), []
    axis = nearest.axis_of(SCENE, "slope", (0.01, 0.1), None)
    found = distances._distance_along(
        axis, SCENE, BranchEvent.FOLD, parts, lambda at: asked.append(at) or located
    )
    assert asked[0].value == value
    assert found.outcome is Sought.MET
    assert found.distance == pytest.approx(abs(value - OWN))
    way = np.sign(value - OWN)
    expected = way * slopes
    expected[NAMES.index("slope")] = -way
    np.testing.assert_allclose(found.slopes, expected)
    np.testing.assert_allclose(found.value_slopes, slopes)


def fold_of_a_map(code):
    """A setup whose return map folds where slope + 2 d + J/2 is constant, at a point or nowhere.

    It moves the first component by that sum beside the square of its distance to the point, and
    forces the second one, which contracts and is forced ten times as hard, too. A looser cycle is
    forced by all parameters alike.
    """
    forces = np.zeros(len(NAMES))
    forces[[NAMES.index(name) for name in ("slope", "d", "J")]] = 1.0, 2.0, 0.5
    jacobian = np.hstack([[[1.0, 0.0], [0.3, 0.6]], [forces, 10.0 * np.arange(len(NAMES))]])
    looser = np.hstack([jacobian[:, :2], np.ones((2, len(NAMES)))])
    seen = SimpleNamespace(code=np.array([code, 0]), jacobian=np.stack([jacobian, looser]))
    axis = nearest.axis_of(SCENE, "slope", (0.0, 0.1), None)
    curve = SimpleNamespace(sizes=np.array([0.5, 2.0, 1.0]))
    parts = dict(scene=SCENE, axis=axis, arrivals=1, curve=curve)
    return SimpleNamespace(**parts, cycle_with=lambda *_: seen)


def test_a_fold_moves_as_what_forces_its_map_allows():
    """At half the range of the slope; the component that contracts has no part in it."""
    fold = SimpleNamespace(place=np.array([0.1, 0.2, 0.5]))
    value, slopes = distances._fold_slopes(fold_of_a_map(0), fold)
    assert value == pytest.approx(0.05)
    expected = np.zeros(len(NAMES))
    expected[[NAMES.index(name) for name in ("d", "J")]] = -2.0, -0.5
    np.testing.assert_allclose(slopes, expected, atol=1e-12)
    assert distances._fold_slopes(fold_of_a_map(3), fold) is None


def test_a_doubling_is_located_by_the_modulus_that_is_one():
    """ρ = 0.998 at 0.03, with the slopes −2 in d and 0.5 in slope: the doubling lies at 0.034."""
    slopes = np.zeros((3, len(NAMES)))
    slopes[1, NAMES.index("d")], slopes[1, NAMES.index("slope")] = -2.0, 0.5
    moduli, errors = np.array([1.3, 0.998, 0.2]), np.full(3, 1e-4)
    told = (moduli, errors, slopes, 0.01 * np.abs(slopes))
    found = distances._moved_to_one(told, 0.03, NAMES.index("slope"))
    assert found.value == pytest.approx(0.03 + 0.002 / 0.5)
    assert found.slopes[NAMES.index("d")] == pytest.approx(4.0)
    assert found.slopes[NAMES.index("slope")] == 0.0
    assert found.error == pytest.approx((1e-4 + 0.004 * 0.005) / 0.5)
    assert found.slope_errors[NAMES.index("d")] == pytest.approx((0.02 + 4.0 * 0.005) / 0.5)


@pytest.mark.parametrize(
    ("events", "end", "outcome"),
    [
        ([], BranchEnd.REACHED, Sought.NONE_IN_RANGE),
        ([], BranchEnd.UNFINISHED, Sought.UNKNOWN),
        ([event(0.03, BranchEvent.NOT_LOCATED)], BranchEnd.REACHED, Sought.UNKNOWN),
        ([event(0.03)], BranchEnd.REACHED, Sought.UNKNOWN),
    ],
)
def test_a_fold_that_was_not_come_to_is_not_known(events, end, outcome):
    """Nor one that is not found again; where both ends were reached the farther one counts."""
    parts = branches(events, [], stop=SimpleNamespace(end=end))
    axis = nearest.axis_of(SCENE, "slope", (OWN / 8.0, 8.0 * OWN), None)
    lost = distances._distance_along(axis, SCENE, BranchEvent.FOLD, parts, lambda at: None)
    assert lost.outcome is outcome
    known = 7.0 * OWN if outcome is Sought.NONE_IN_RANGE else np.nan
    assert lost.distance == pytest.approx(known, nan_ok=True)

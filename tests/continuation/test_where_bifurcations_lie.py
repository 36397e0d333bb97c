"""The nearest bifurcation and the distance to it, against numbers written down."""

from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.continuation import _critical_values as nearest
from jaxbiped.continuation._bifurcations import BranchEvent
from jaxbiped.optimise import _bifurcation_distance as distances
from jaxbiped.optimise._bifurcation_distance import Sought

SCENE = jb.ladder()["rigid"]
NAMES = jb.parameter_names(SCENE)
OWN = float(jb.parameter_values(SCENE)["slope"])


def event(value, kind=BranchEvent.FOLD):
    point = SimpleNamespace(value=value, place=np.array([value]), recurring=np.zeros(1))
    told = dict(multiplier=1.0 + 0j, error=0.01, beyond=np.nan)
    return SimpleNamespace(value=value, kind=kind, point=point, **told)


GAIT = SimpleNamespace(
    step_lengths=np.zeros(1), measures=SimpleNamespace(state=jb.dynamics.RigidState(0, 1, 1, 1, 1))
)


def follows(monkeypatch, before, after):
    """Branches through a gait: events to both sides, in their order away from it."""
    asked = {}
    parts = [SimpleNamespace(bifurcations=events) for events in (before, after)]
    monkeypatch.setattr(nearest, "axis_of", lambda *given: asked.update(bounds=given[2]))
    monkeypatch.setattr(nearest, "continuation_setup", lambda *_, **__: None)
    monkeypatch.setattr(nearest, "state_of_guess", lambda *_: None)
    monkeypatch.setattr(nearest, "first_gait", lambda *_: SimpleNamespace())
    monkeypatch.setattr(nearest, "traces_from", lambda *_, **how: asked.update(how) or parts)
    return asked


@pytest.mark.parametrize(
    ("slope", "before", "after", "first"),
    [(0.02, 0.005, 0.05, 0.05), (0.02, 0.01, 0.05, 0.01), (0.0, -0.01, 0.005, 0.005)],
)
def test_the_nearest_is_that_of_the_smallest_factor(slope, before, after, first, monkeypatch):
    asked = follows(monkeypatch, [event(before)], [event(after)])
    scene = jb.with_parameters(SCENE, {"slope": slope})
    found = nearest.nearest_bifurcation(scene, GAIT)
    assert set(asked["until"]) == set(BranchEvent)
    assert found.value == first
    assert (found.kind, found.error) == (BranchEvent.FOLD, 0.01)
    if slope:
        assert found.ratio == pytest.approx(first / slope)
        assert asked["bounds"] == pytest.approx((slope / 8.0, slope * 8.0))
    else:
        assert np.isnan(found.ratio)
        assert asked["bounds"] == (-0.1, 0.1)


def test_what_lies_beyond_a_fold_is_another_gaits(monkeypatch):
    """The branch turns back at 0.05, and doubles near the gait's own value, but not that gait."""
    doubling = event(0.021, BranchEvent.PERIOD_DOUBLING)
    follows(monkeypatch, [event(0.004)], [event(0.05), doubling])
    found = nearest.nearest_bifurcation(jb.with_parameters(SCENE, {"slope": 0.02}), GAIT)
    assert (found.kind, found.value) == (BranchEvent.FOLD, 0.05)


def test_where_one_was_not_located_the_nearer_end_counts(monkeypatch):
    later = event(0.08, BranchEvent.NOT_LOCATED)
    later.beyond = 0.025
    follows(monkeypatch, [event(0.01)], [later])
    scene = jb.with_parameters(SCENE, {"slope": 0.02})
    assert nearest.nearest_bifurcation(scene, GAIT).kind is BranchEvent.NOT_LOCATED


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
def test_a_distance_moves_with_the_bifurcation_and_against_the_gait(value, monkeypatch):
    slopes = np.arange(len(NAMES)) * 0.1
    slopes[NAMES.index("slope")] = 0.0
    located = distances.Functional(value, 1e-6, slopes, 0.01 * slopes)
    other = OWN + 0.02
    parts = [SimpleNamespace(bifurcations=[event(x)], stop=None) for x in (other, value)]
    asked = []
    monkeypatch.setattr(distances, "continuation_setup", lambda *_, **__: None)
    monkeypatch.setattr(distances, "_both_ways", lambda *_: parts)
    monkeypatch.setattr(distances, "_located_fold", lambda _, at: asked.append(at) or located)
    gait = SimpleNamespace(step_lengths=np.zeros(1), engine="lanes")
    found = distances.bifurcation_distance(SCENE, gait)
    assert asked[0].value == value
    assert found.outcome is Sought.MET
    assert found.distance == pytest.approx(abs(value - OWN))
    way = np.sign(value - OWN)
    expected = way * slopes
    expected[NAMES.index("slope")] = -way
    np.testing.assert_allclose(found.slopes, expected)
    np.testing.assert_allclose(found.value_slopes, slopes)


def test_a_doubling_is_located_by_the_modulus_that_is_one(monkeypatch):
    """ρ = 0.998 at 0.03, with the slopes −2 in d and 0.5 in slope: the doubling lies at 0.034."""
    slopes = np.zeros((3, len(NAMES)))
    slopes[1, NAMES.index("d")], slopes[1, NAMES.index("slope")] = -2.0, 0.5
    moduli = np.array([1.3, 0.998, 0.2])
    told = (moduli, np.full(3, 1e-4), slopes, 0.01 * np.abs(slopes), 0)
    monkeypatch.setattr(distances, "jacobian_functionals", lambda *_, **__: told)
    setup = SimpleNamespace(
        scene=SCENE, axis=SimpleNamespace(name="slope"), arrivals=2, accuracy="tight",
        state_of=lambda point: None,
        problem=SimpleNamespace(spec=SimpleNamespace(engine="lanes")),
    )  # fmt: skip
    at = SimpleNamespace(value=0.03, point=SimpleNamespace(recurring=None))
    found = distances._located_doubling(setup, at)
    assert found.value == pytest.approx(0.03 + 0.002 / 0.5)
    assert found.slopes[NAMES.index("d")] == pytest.approx(4.0)
    assert found.slopes[NAMES.index("slope")] == 0.0
    assert found.error == pytest.approx((1e-4 + 0.004 * 0.005) / 0.5)
    assert found.slope_errors[NAMES.index("d")] == pytest.approx((0.02 + 4.0 * 0.005) / 0.5)

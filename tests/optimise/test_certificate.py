"""Certificate of an optimum: each of its parts against what it stands for."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow
RIGID = jb.ladder()["rigid"]


@pytest.fixture(scope="module")
def best():
    return jb.optimise_gait(
        RIGID, vary={"d": (0.08, 0.12), "r": (0.06, 0.1)}, minimise="spectral_radius"
    )


def test_a_stable_gait_is_certified(best, capsys, stages_at_once):
    found = jb.optimise.certify(
        best, starts=256, footsteps=50, bifurcations_along=(), progress=True
    )
    assert found.failed == {}
    assert "certifying the optimum: 4 of 4 parts" in capsys.readouterr().err
    own = jb.find_gait(RIGID, parameters=(), radius_sensitivities=False)
    assert found.stable is True
    assert np.abs(found.multipliers[0]) == pytest.approx(best.objective, rel=1e-4)
    assert np.abs(found.multipliers[0]) < float(own.measures.spectral_radius)
    assert found.walk.returned
    assert found.walk.footsteps == 50
    assert 0.0 < found.basin.low < found.basin.estimate < found.basin.high <= 1.0
    assert found.unit_multiplier_error < 1e-5
    assert found.sensitivity_norm[1] < 1e-4 * found.sensitivity_norm[0]
    assert found.other_engine is None
    assert found.fatal_push is None
    assert found.nearest_bifurcations == ()


def test_the_fatal_push_is_that_of_labels(best):
    found = jb.optimise.certify(best, starts=0, footsteps=0, bifurcations_along=(), fatal_push=True)
    push, state = found.fatal_push.push, best.gait.measures.state
    label = jb.labelling(best.scene, guess=state)
    ends = []
    for share in (0.99, 1.01):
        moved = np.array([float(leaf) for leaf in state[1:]]) + share * push
        start = jb.dynamics.RigidState(np.zeros(1), *moved[:, None])
        ends.append(jb.basins.Label(int(label(start).label[0])))
    assert 0.0 < found.fatal_push.distance < 1.0
    assert ends[0] is jb.basins.Label.WALKING
    assert ends[1] is not jb.basins.Label.WALKING
    assert found.basin is None


def test_parts_fail_by_themselves_and_under_their_names(best):
    """Another walker's state fits none of them; so many starts fit no memory."""
    measures = best.gait.measures._replace(state=jb.seed_state())
    other = dataclasses.replace(best, gait=dataclasses.replace(best.gait, measures=measures))
    found = jb.optimise.certify(other, starts=256, footsteps=50)
    assert list(found.failed) == [
        "gait sensitivity norm",
        "gaits that starts may come to",
        "walk of 50 footsteps",
        "nearest bifurcation along slope",
    ]
    assert found.stable is True
    assert found.failed["walk of 50 footsteps"].startswith("ArgumentError: state = a State is not")
    found = jb.optimise.certify(best, starts=10**15, footsteps=0, bifurcations_along=())
    assert list(found.failed) == ["basin of 1000000000000000 starts"]
    assert np.isfinite(found.sensitivity_norm[0])


def test_an_unstable_gait_does_not_return():
    long = jb.with_parameters(RIGID, {"slope": 0.12})
    still = jb.optimise_gait(long, vary={"d": (0.0999, 0.1001)}, minimise="period", iterations=1)
    assert float(still.gait.measures.spectral_radius) > 1.0
    found = jb.optimise.certify(still, starts=0, footsteps=60, bifurcations_along=())
    assert found.stable is False
    assert found.basin is None
    assert not found.walk.returned
    assert found.sensitivity_norm[0] == np.inf


def test_the_nearest_bifurcation_is_where_searches_lose_stability(best):
    found = jb.optimise.certify(best, starts=0, footsteps=0)
    (nearest,) = found.nearest_bifurcations
    assert nearest.kind is jb.continuation.BranchEvent.PERIOD_DOUBLING
    assert abs(nearest.multiplier + 1.0) < 1e-6
    radii = [
        jb.find_gait(
            jb.with_parameters(best.scene, {"slope": nearest.value * share}),
            parameters=(),
            radius_sensitivities=False,
        ).measures.spectral_radius
        for share in (0.995, 1.005)
    ]
    assert float(radii[0]) < 1.0 < float(radii[1])
    assert found.walk is None


@pytest.mark.nightly
def test_the_other_engine_finds_the_same_gait(best):
    found = jb.optimise.certify(
        best, starts=0, footsteps=0, bifurcations_along=(), other_engine=True
    )
    assert found.other_engine.engine == "xla"
    assert found.other_engine.found
    assert found.other_engine.period_difference < 1e-7
    assert found.other_engine.radius_difference < 1e-5


def test_certify_refuses_what_is_no_optimum(best):
    with pytest.raises(jb.ArgumentError, match="optimum"):
        jb.optimise.certify(best.gait)
    with pytest.raises(jb.ArgumentError, match="starts = -1"):
        jb.optimise.certify(best, starts=-1)
    with pytest.raises(jb.ArgumentError, match="bifurcations_along = 'steepness'"):
        jb.optimise.certify(best, bifurcations_along=("steepness",))

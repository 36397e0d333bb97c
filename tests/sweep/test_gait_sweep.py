"""Sweeps of gaits, against single searches: without holes, in memory and in a store."""

import numpy as np
import pytest
import xarray

import jaxbiped as jb
from jaxbiped.sweep import _gait_grid, _gait_sweep

pytestmark = pytest.mark.slow

PLAIN = dict(parameters=("K",), radius_sensitivities=False)
OVER = {"slope": [0.005, 0.012, 0.02, 0.03], "K": [1e6, 1.1e6]}


@pytest.fixture(scope="module")
def swept():
    return jb.gait_sweep(jb.seed_scene(), OVER, **PLAIN)


def test_one_stable_branch_is_followed(swept):
    assert swept.period.dims == ("slope", "K")
    np.testing.assert_allclose(
        swept.period.sel(K=1e6).data[1:], [0.4355445, 0.4408348, 0.4464368], atol=1e-6
    )
    assert np.all(swept.spectral_radius.data[1:] < 1.0)
    assert np.all(swept.ending.data[1:] == int(jb.gait.Search.FOUND))


def test_where_there_is_no_gait_numbers_are_nan(swept):
    flat = swept.sel(slope=0.005)
    assert np.all(flat.ending != int(jb.gait.Search.FOUND))
    assert np.all(np.isnan(flat.period))
    assert np.all(np.isnan(flat.elasticity_period))
    assert np.all(flat.branch_end == int(jb.gait.BranchEnd.FOLD))


def test_elasticities_promise_the_neighbour(swept):
    """d log T / d log K by the trapezium rule between two values of K."""
    at = swept.sel(slope=0.02)
    slopes = at.elasticity_period.sel(parameter="K").data
    promised = 0.5 * (slopes[0] + slopes[1]) * np.log(1.1)
    assert np.log(at.period.data[1] / at.period.data[0]) == pytest.approx(promised, abs=1e-6)


def test_a_killed_sweep_continues_from_its_store(tmp_path, monkeypatch):
    """The points that were written are not searched again, and the whole equals one in memory."""
    over = {"slope": [0.018, 0.02, 0.022]}
    whole = jb.gait_sweep(jb.seed_scene(), over, **PLAIN)
    calls, find = [], _gait_sweep.find_gait

    def counted(scene, *rest, **options):
        if len(calls) == 2:
            raise KeyboardInterrupt
        calls.append(float(scene.ground.slope))
        return find(scene, *rest, **options)

    monkeypatch.setattr(_gait_sweep, "find_gait", counted)
    monkeypatch.setattr(_gait_grid, "_PAUSE", -1.0)
    with pytest.raises(KeyboardInterrupt):
        jb.gait_sweep(jb.seed_scene(), over, store=tmp_path / "gaits", **PLAIN)
    assert calls[0] == 0.02
    first, calls[:] = list(calls), []
    monkeypatch.setattr(_gait_sweep, "find_gait", lambda *a, **o: calls.append(a) or find(*a, **o))
    again = jb.gait_sweep(jb.seed_scene(), over, store=tmp_path / "gaits", **PLAIN)
    searched = [float(scene.ground.slope) for scene, *_ in calls]
    # The last point that was written is known; the first is looked at for the shapes.
    assert set(searched) == {0.02, *over["slope"]} - set(first[1:])
    xarray.testing.assert_allclose(again.load(), whole, rtol=1e-9)


def test_a_store_of_another_sweep_is_refused(tmp_path):
    path = tmp_path / "gaits"
    jb.gait_sweep(jb.seed_scene(), {"slope": [0.02]}, store=path, **PLAIN)
    with pytest.raises(jb.ArgumentError, match="other settings"):
        jb.gait_sweep(jb.seed_scene(), {"slope": [0.021]}, store=path, **PLAIN)


@pytest.mark.parametrize(
    ("over", "named"),
    [
        ({}, "over"),
        ({"stiffness": [1.0]}, "stiffness"),
        ({"K": []}, "K"),
        ({"K": [-1.0]}, "K"),
        ({"K": [[1.0]]}, "K"),
    ],
)
def test_bad_arguments(over, named):
    with pytest.raises(jb.ArgumentError, match=named):
        jb.gait_sweep(jb.seed_scene(), over)

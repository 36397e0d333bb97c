"""Sweeps of gaits, against single searches: without holes, in memory and in a store."""

import numpy as np
import pytest
import xarray
import zarr

import jaxbiped as jb

pytestmark = pytest.mark.slow

PLAIN = dict(parameters=("K",), radius_sensitivities=False)
PLAIN_RIGID = dict(parameters=("d",), radius_sensitivities=False)
OVER = {"slope": [0.005, 0.012, 0.02, 0.03], "K": [1e6, 1.1e6]}


@pytest.fixture(scope="module")
def swept():
    with pytest.warns(RuntimeWarning, match="no gait was found at 2 of the 8 points.*: 2 of them"):
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


@pytest.mark.filterwarnings("ignore:no gait was found at 1 of the 3")
def test_a_sweep_of_few_points_continues_from_its_store(tmp_path):
    """What was written is not searched again, a point without a gait neither."""
    scene, over = jb.ladder()["rigid"], {"slope": [-0.02, 0.02, 0.025]}
    whole = jb.gait_sweep(scene, over, **PLAIN_RIGID)
    assert list(whole.ending == int(jb.gait.Search.FOUND)) == [False, True, True]
    jb.gait_sweep(scene, over, store=tmp_path / "gaits", **PLAIN_RIGID)
    group = zarr.open_group(str(tmp_path / "gaits"), use_consolidated=False)
    group["done"][2], group["period"][:] = 0, [7.0, whole.period.values[1], 9.0]
    for _ in range(2):
        again = jb.gait_sweep(scene, over, store=tmp_path / "gaits", **PLAIN_RIGID).load()
        np.testing.assert_array_equal(again.period, [7.0, *whole.period.values[1:]])
    again.period[0] = np.nan
    xarray.testing.assert_equal(again, whole)

"""A trajectory as a labelled dataset."""

import numpy as np
import pytest
import xarray

import jaxbiped as jb


def test_round_trip_through_a_file(seed_walk, tmp_path):
    scene, walk = seed_walk
    dataset = jb.trajectory_dataset(scene, walk)
    dataset.to_netcdf(tmp_path / "walk.nc")
    with xarray.open_dataset(tmp_path / "walk.nc") as read:
        np.testing.assert_array_equal(read.theta_1, walk.state.theta_1)
        assert read.attrs["ending"] == "walking"
        assert read.attrs["normal.K"] == 1e6
        assert read.normal_force.dims == ("leg", "time")
        assert read.normal_force.units == "N"
        expected = jb.foot_forces(scene, walk.state).foot_2.normal
        np.testing.assert_array_equal(read.normal_force.sel(leg=2), expected)
        total = read.kinetic_energy + read.gravitational_energy + read.elastic_energy
        assert float(total[-1] - total[0]) < 0.0


def test_a_frictionless_walk_has_no_tangential_force():
    seed = jb.seed_scene()
    scene = jb.Scene(seed.walker, seed.ground, seed.normal, jb.Frictionless())
    fall = jb.simulate(scene, jb.seed_state(), duration=0.1)
    assert "tangential_force" not in jb.trajectory_dataset(scene, fall)
    batch = fall.__class__(fall.t[None], fall.state, fall.ending, 0, 0, None)
    with pytest.raises(ValueError, match="batch"):
        jb.trajectory_dataset(scene, batch)

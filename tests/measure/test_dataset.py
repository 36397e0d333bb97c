"""A trajectory as a labelled dataset, against the trajectory."""

import dataclasses
import json

import numpy as np
import pytest
import xarray

import jaxbiped as jb


def test_round_trip_through_a_file(seed_walk, tmp_path):
    scene, walk = seed_walk
    dataset = jb.measure.trajectory_dataset(scene, walk)
    dataset.to_netcdf(tmp_path / "walk.nc")
    with xarray.open_dataset(tmp_path / "walk.nc") as read:
        np.testing.assert_array_equal(read.theta_1, walk.state.theta_1)
        assert read.attrs["ending"] == "walking"
        assert read.attrs["normal.K"] == 1e6
        assert json.loads(read.attrs["parameter_units"])["normal.K"] == "N/m^n"
        told = {name: read[name].units for name in read.data_vars if not name.startswith("hip")}
        angles = {"theta_1": "rad", "theta_2": "rad", "omega_1": "rad/s", "omega_2": "rad/s"}
        energies = dict.fromkeys(("kinetic_energy", "gravitational_energy", "elastic_energy"), "J")
        feet = {"normal_force": "N", "tangential_force": "N", "penetration": "m",
                "slip_speed": "m/s", "touches": "1"}  # fmt: skip
        assert told == angles | energies | feet
        assert read.normal_force.dims == ("foot", "time")
        expected = jb.dynamics.foot_forces(scene, walk.state)[1].normal
        np.testing.assert_array_equal(read.normal_force.sel(foot="2"), expected)
        assert read.leg.values.tolist() == ["1", "2"]
        total = read.kinetic_energy + read.gravitational_energy + read.elastic_energy
        assert float(total[-1] - total[0]) < 0.0


def test_a_frictionless_walk_has_no_tangential_force():
    seed = jb.seed_scene()
    scene = jb.Scene(seed.walker, seed.ground, seed.normal, jb.laws.Frictionless())
    fall = jb.simulate(scene, jb.seed_state(), duration=0.1)
    assert "tangential_force" not in jb.measure.trajectory_dataset(scene, fall)
    batch = fall.__class__(fall.t[None], fall.state, fall.ending, 0, 0, None)
    with pytest.raises(ValueError, match="batch"):
        jb.measure.trajectory_dataset(scene, batch)


_SEED = dict(K=1e6, c=1e7, n=1.5, mass=2.0), dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1e3)
_LAWS = {
    **{name: {"normal": jb.laws.normal_law_like(name, **_SEED[0])} for name in jb.laws.NORMAL_LAWS},
    **{
        name: {"friction": jb.laws.friction_law_like(name, **_SEED[1])}
        for name in jb.laws.FRICTION_LAWS
    },
}


@pytest.fixture(scope="module")
def short_walk():
    return jb.simulate(jb.seed_scene(), jb.seed_state(), duration=0.05)


@pytest.mark.parametrize("name", _LAWS)
def test_every_law_goes_into_a_file(name, short_walk, tmp_path):
    """With a motion of the seed's own law, where no law needs a program of its own."""
    scene = dataclasses.replace(jb.seed_scene(), **_LAWS[name])
    state = short_walk.state
    if isinstance(scene.friction, jb.laws.AbstractBristleLaw):
        straight = np.zeros_like(state.hip_x)
        state = jb.dynamics.BristleState(**state._asdict(), bristle_1=straight, bristle_2=straight)
    motion = dataclasses.replace(short_walk, state=state, scene_key=None)
    jb.measure.trajectory_dataset(scene, motion).to_netcdf(tmp_path / "walk.nc")
    ((part, law),) = _LAWS[name].items()
    known = {field: value for field, value in vars(law).items() if value is not None}
    with xarray.open_dataset(tmp_path / "walk.nc") as read:
        assert read.attrs[part] == type(law).__name__
        for field, value in known.items():
            assert read.attrs[f"{part}.{field}"] == float(value)
        assert set(state._fields) <= set(read.data_vars)
        assert np.isfinite(read.normal_force).all()


def test_forces_on_rigid_feet_carry_the_mass_and_nothing_else():
    # A point mass at the hip: the ground's force is what accelerates it beside gravity.
    scene, slope = jb.models.garcia(), 0.009
    state = scene.state(theta_1=-0.2, theta_2=0.2, omega_1=-0.1834, omega_2=-0.2)
    times, step = np.linspace(0.5, 3.0, 6), 1e-4
    near = np.sort(np.concatenate([times - step, times, times + step]))
    walk = jb.simulate(scene, state, duration=4.5, save=near, accuracy="tight")
    place = jb.dynamics.whole_state(scene, walk.state)
    x, z = (np.asarray(leaf).reshape(-1, 3) for leaf in (place.hip_x, place.hip_z))
    along, up = ((leaf @ [1.0, -2.0, 1.0]) / step**2 for leaf in (x, z))
    data = jb.measure.trajectory_dataset(scene, walk).isel(time=slice(1, None, 3))
    np.testing.assert_allclose(data.normal_force[1], up + np.cos(slope), atol=1e-6)
    np.testing.assert_allclose(data.tangential_force[1], along - np.sin(slope), atol=1e-6)
    np.testing.assert_array_equal(data.normal_force[0], 0.0)
    assert {"penetration", "slip_speed", "touches"}.isdisjoint(data)


def test_a_dataset_of_rigid_steps_has_both_sides_of_each_strike():
    scene = jb.models.garcia()
    state = scene.state(theta_1=-0.2, theta_2=0.2, omega_1=-0.1834, omega_2=-0.2)
    walk = jb.simulate(scene, state, footsteps=2, save="steps")
    data = jb.measure.trajectory_dataset(scene, walk)
    (before,) = np.nonzero(np.diff(data.time) == 0.0)
    assert len(before) == 2
    lost = np.asarray(data.kinetic_energy)[before] - np.asarray(data.kinetic_energy)[before + 1]
    assert np.all(lost > 0.0)
    total = data.kinetic_energy + data.gravitational_energy
    np.testing.assert_allclose(total[: before[0] + 1], total[0], rtol=1e-6)


def test_actuators_are_told_by_their_places(short_walk):
    spline = jb.actuation.HipSpline([0.1, 0.2], reaction="trunk")
    scene = dataclasses.replace(jb.seed_scene(), actuation=(jb.actuation.HipSpring(k=0.3), spline))
    told = jb.measure.trajectory_dataset(
        scene, dataclasses.replace(short_walk, scene_key=None)
    ).attrs
    assert told["actuation_1"] == "HipSpring"
    assert told["actuation_1.k"] == 0.3
    assert "actuation_1.theta_0" not in told
    assert told["actuation_2.torque_2"] == 0.2
    assert told["actuation_2.reaction"] == "trunk"
    units = json.loads(told["parameter_units"])
    assert units["actuation_1.k"] == "N m/rad"
    assert units["actuation_2.torque_1"] == "N m"
    assert "actuation" not in jb.measure.trajectory_dataset(jb.seed_scene(), short_walk).attrs

"""Footsteps, ledgers and costs of mechanisms, against contacts that are sampled densely."""

import jax.tree_util as jtu
import numpy as np
import pytest
import xarray

import jaxbiped as jb
from tests.mechanisms import BISECTING, FEET, LEGS, PAIR, TORSO, WALKERS

LAWS = dict(
    normal=jb.laws.RistowSchafer(K=1e6, c=1e7),
    friction=jb.laws.BengisuAkay(0.5, 0.4, 1e-4, 1000.0),
)
POSES = {
    "flat": dict(
        theta_leg_1=-0.2, theta_foot_1=-0.2, theta_leg_2=0.2, theta_foot_2=0.2, omega_leg_2=-1.8,
        omega_foot_2=-1.8,
    ),
    "unequal": dict(theta_leg_1=-0.25, theta_leg_2=0.17, omega_leg_2=-1.3),
}  # fmt: skip


@pytest.fixture(scope="module", params=POSES)
def walked(request):
    """A scene and a walk of two seconds, legs cleared as the seed's are."""
    scene = jb.Scene(
        walker=WALKERS[request.param],
        ground=jb.Ground(slope=0.03),
        clearance=jb.laws.StanceRotation(),
        **LAWS,
    )
    stands = scene.mechanism.structure.feet_told[-1].partition(".")[0]
    start = scene.state(**POSES[request.param], standing=stands)
    start = start._replace(hip_z=start.hip_z - 5e-4)
    return scene, jb.simulate(scene, start, duration=2.0, engine="lanes")


def _strikes(scene, walk):
    """Times, legs and places at which legs come down ahead of the other, one after the other."""
    times = np.linspace(0.0, float(walk.t[-1]), 40001)
    feet = jtu.tree_map(np.asarray, jb.dynamics.feet(scene, walk.at(times)))
    structure = scene.mechanism.structure
    touches = [
        np.any([(feet[k].penetration > 0.0) & feet[k].admitted for k in own], axis=0)
        for own in structure.feet_of_leg
    ]
    places = [np.mean([feet[k].x for k in own], axis=0) for own in structure.feet_of_leg]
    found, last = [], None
    for k in range(1, len(times)):
        for leg, own in enumerate(structure.feet_of_leg):
            ahead = places[leg][k] > places[1 - leg][k]
            if touches[leg][k] and not touches[leg][k - 1] and ahead and leg != last:
                deepest = max(own, key=lambda foot: feet[foot].penetration[k])
                found.append((times[k], leg, feet[deepest].x[k]))
                last = leg
    return found


def test_footsteps_are_those_of_legs(walked):
    """A toe that follows its heel makes no footstep, though each foot makes two contacts."""
    scene, walk = walked
    steps, legs = jb.footsteps(scene, walk), scene.mechanism.structure.legs
    expected = [each for each in _strikes(scene, walk) if each[0] > 0.01]
    count = min(len(expected), len(steps.leg))
    assert count >= 2
    times, numbers, places = zip(*expected[-count:], strict=True)
    np.testing.assert_allclose(steps.time_s[-count:], times, atol=6e-5)
    assert steps.leg[-count:].tolist() == [legs[k] for k in numbers]
    np.testing.assert_allclose(steps.length_m[1 - count :], np.diff(places), atol=2e-4)
    assert all(one != other for one, other in zip(steps.leg[1:], steps.leg, strict=False))


def test_ledgers_of_footsteps_close(walked):
    scene, walk = walked
    steps = jb.footsteps(scene, walk)
    weight = float(scene.mechanism.total_mass) * 9.8
    assert np.all(np.abs(steps.energy_residual_J) < 1e-4 * weight * steps.length_m * 0.03)
    cost = jb.measure.cost_of_transport(scene, walk, np.array([0.0, float(walk.t[-1])]))
    ledger = jb.measure.energy_ledger(scene, walk)
    np.testing.assert_allclose(cost.gravity_work, ledger.gravity_work, rtol=1e-9)
    np.testing.assert_allclose(cost.cost, ledger.gravity_work / (weight * cost.distance))


def test_a_dataset_has_feet_and_parameters_by_name(walked, tmp_path):
    scene, walk = walked
    jb.measure.trajectory_dataset(scene, walk).to_netcdf(tmp_path / "walk.nc")
    structure = scene.mechanism.structure
    with xarray.open_dataset(tmp_path / "walk.nc") as read:
        assert read.foot.values.tolist() == list(structure.feet_told)
        assert read.leg.values.tolist() == [structure.legs[k] for k in structure.leg_of_foot]
        forces = jb.dynamics.foot_forces(scene, walk.state)
        np.testing.assert_array_equal(read.normal_force, [each.normal for each in forces])
        for name in structure.rates[2:]:
            assert read[name].units == "rad/s"
        names = scene.walker.parameter_names()
        told = [read.attrs[f"walker.{name}"] for name in names]
        np.testing.assert_array_equal(told, jtu.tree_leaves(scene.walker))


@pytest.mark.slow
def test_a_damper_s_loss_behind_an_impact_closes_the_ledger():
    """The torso comes to rest on its spring within a fiftieth of the footstep."""
    spring = jb.Spring(BISECTING, stiffness=16.0, damping=3.0)
    walker = jb.Mechanism(bodies=(*LEGS, TORSO), feet=FEET, joints=(spring,), mirror=PAIR)
    scene = jb.RigidScene(walker, jb.Ground(slope=0.03))
    start = scene.state(theta_leg_1=-0.28, theta_leg_2=0.28, omega_leg_1=-1.1, omega_leg_2=-1.7)
    walk = jb.rigid_walk(scene, start, footsteps=4, max_arrivals=4, accuracy="tight")
    books = jb.measure.rigid_ledger(scene, walk)
    assert np.all(books.joint_loss > 1e-4)
    np.testing.assert_allclose(books.residual, 0.0, atol=1e-8)

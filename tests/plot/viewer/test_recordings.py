"""Recordings, against the walks of every kind between their knots."""

import base64
import dataclasses

import jax
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import jaxbiped as jb
from jaxbiped.plot._samples import DrawnMotion
from jaxbiped.plot._skeleton import motion_names, poses
from jaxbiped.plot.viewer._recording import recording
from tests.mechanisms import BISECTING, FEET, LEGS, PAIR, scene_of, start_of

pytestmark = pytest.mark.slow

START = jb.seed_state()
LADDER = jb.ladder()


def recorded(*arguments, **options):
    return jb.plot.view(*arguments, **options).recordings[0]


def played(recording, t):
    """Hip and angles as the page has them at times, from what it is sent."""
    sent = recording.numbers()
    knots = np.frombuffer(base64.b64decode(sent["t"]), "<f8")
    channel = lambda name: np.frombuffer(base64.b64decode(sent["channels"][name]), "<f4")
    pairs = ("hip_x", "hip_vx"), ("hip_z", "hip_vz"), ("theta_1", "omega_1"), ("theta_2", "omega_2")
    return [CubicHermiteSpline(knots, *map(channel, pair))(t) for pair in pairs]


def feet_of(recording, t):
    x, z, *angles = played(recording, t)
    reach = 0.40 - 0.08
    return [(x + reach * np.sin(a), z - reach * np.cos(a)) for a in angles]


@pytest.mark.parametrize("name", ["seed", "steep", "bristles", "redundant"])
def test_feet_are_where_they_were(name):
    scene = {
        "seed": jb.seed_scene(),
        "steep": jb.seed_scene(slope=0.04),
        "bristles": LADDER["bristles"],
        "redundant": jb.RedundantScene(jb.seed_scene()),
    }[name]
    start = jb.dynamics.redundant_state(scene, START) if name == "redundant" else START
    # Explicit steps compile quickly: redundant coordinates need them for a moment only.
    how = {"duration": 0.02, "solver": "tsit5"} if name == "redundant" else {"duration": 2.0}
    walk = jb.simulate(scene, start, accuracy="draft", **how)
    found = recorded(scene, walk)
    assert found.ending == ("fell forward" if name == "steep" else "walking")
    end = float(walk.t[-1])
    assert found.t[[0, -1]].tolist() == [0.0, end]
    t = np.linspace(0.0, end, 4001)
    there = jb.dynamics.feet(scene, walk.at(t))
    for (x, z), foot in zip(feet_of(found, t), there, strict=True):
        np.testing.assert_allclose(x, foot.x, rtol=0.0, atol=2e-5)
        np.testing.assert_allclose(z, foot.z, rtol=0.0, atol=2e-5)


def test_forces_and_energies_are_those_of_the_walk(seed_walk):
    scene, walk = seed_walk
    found = recorded(scene, walk)
    t = np.asarray(walk.t)
    forces = jb.dynamics.foot_forces(scene, walk.state)
    weight = float(scene.walker.total_mass * scene.ground.g)
    assert found.weight == pytest.approx(weight)
    for leg, force in enumerate(forces, 1):
        normal, peak = found.channels[f"normal_{leg}"], float(force.normal.max())
        shown = np.interp(t, found.t, normal)
        assert np.abs(shown - force.normal).max() < 0.15 * weight
        assert normal.max() == pytest.approx(peak, rel=0.02)
    books = jb.measure.energy_ledger(scene, walk)
    assert found.channels["supplied"][-1] == pytest.approx(float(books.gravity_work[0]))
    lost = float(books.damper_loss[0] + books.friction_loss[0])
    assert found.channels["lost"][-1] == pytest.approx(lost, rel=1e-5)


def test_motors_and_losses_of_a_rigid_walk_are_those_of_its_ledger():
    """A torso held by a motor and a damper, and a push-off at each heel strike."""
    law = jb.actuation.PD(kp=6.0, kd=0.6, target=0.03, of={"torso": 1, "vertical": -1})
    walker = jb.Mechanism(
        bodies=(*LEGS, jb.Body("torso", mass=0.5, inertia=0.003, centre=-0.15)),
        feet=FEET,
        joints=(
            jb.Motor({"torso": 1, "leg_2": -1}, law),
            jb.Spring(BISECTING, stiffness=2.0, damping=0.05),
        ),
        mirror=PAIR,
    )
    scene = jb.RigidScene(walker, jb.Ground(slope=0.03), jb.actuation.PushOff(0.02))
    start = scene.state(
        theta_leg_1=-0.27, theta_leg_2=0.27, theta_torso=0.09,
        omega_leg_1=-0.9, omega_leg_2=-1.6, omega_torso=-0.4,
    )  # fmt: skip
    walk = jb.rigid_walk(scene, start, footsteps=3, max_arrivals=3, accuracy="tight")
    played, books = recorded(scene, walk), jb.measure.rigid_ledger(scene, walk)
    assert played.driven
    strikes = np.searchsorted(played.t, np.asarray(walk.arrivals.t)[1:])
    lost = books.impact_loss + books.joint_loss
    for name, sums in (("driven", books.actuation_work), ("lost", lost)):
        shown = played.channels[name][strikes[:1]]
        np.testing.assert_allclose(shown, sums[:1], rtol=0.0, atol=1e-6)
    assert abs(books.actuation_work[0]) > 1e-3
    held = sum(played.channels[name] for name in ("kinetic", "elastic", "lost"))
    given = played.channels["supplied"] + played.channels["driven"]
    np.testing.assert_allclose(held - held[0], given, rtol=0.0, atol=1e-9)


@pytest.mark.nightly
def test_motors_of_a_compliant_walk_are_those_of_its_ledger(seed_walk):
    scene = dataclasses.replace(
        seed_walk[0], actuation=(jb.actuation.HipTorque(0.02), jb.actuation.FootPreload(5e-4))
    )
    walk = jb.simulate(scene, START, footsteps=2, engine="lanes")
    played, books = recorded(scene, walk), jb.measure.energy_ledger(scene, walk)
    assert played.channels["driven"][-1] == pytest.approx(books.actuation_work[0], rel=1e-6)
    lost = books.damper_loss[0] + books.friction_loss[0]
    assert played.channels["lost"][-1] == pytest.approx(lost, rel=1e-4)


@pytest.mark.parametrize(("name", "first", "kept"), [("theta_1", 3, 3), ("hip_vx", 1, 2)])
def test_a_walk_is_shown_as_far_as_its_states_are_numbers(name, first, kept):
    """Two knots at least, which a page can draw."""
    scene, t = jb.seed_scene(), np.linspace(0.0, 1.0, 6)
    channels = {each: t + 1.0 for each in motion_names(scene.mechanism.structure)}
    channels |= {"normal_1": np.full(6, np.nan), name: np.where(np.arange(6) < first, 1.0, np.inf)}
    found = recording(scene, "walk", jb.Ending.SOLVER_FAILED, t, channels, [])
    assert (found.ending, found.driven, found.slope) == ("solver failed", False, 0.02)
    assert found.t.tolist() == t[:kept].tolist()
    assert {len(values) for values in found.channels.values()} == {kept}


def test_without_gravity_a_walker_drifts_as_the_walk_says():
    """Its weight measures no error there."""
    scene = jb.with_parameters(jb.seed_scene(), {"g": 0.0})
    walk = jb.simulate(scene, START._replace(hip_vz=np.float64(0.5)), duration=0.5)
    found = recorded(scene, walk)
    assert found.weight == 0.0
    t = np.linspace(0.0, 0.5, 20)
    for shown, name in zip(played(found, t), ("hip_x", "hip_z", "theta_1", "theta_2"), strict=True):
        np.testing.assert_allclose(shown, getattr(walk.at(t), name), atol=2e-3)


def test_footprints_are_the_heel_strikes(seed_walk):
    scene, walk = seed_walk
    prints = recorded(scene, walk).footprints
    assert [each.strike for each in prints] == [False] + [True] * (len(prints) - 1)
    assert [each.leg for each in prints] == [2, 1, 2, 1, 2][: len(prints)]
    steps = jb.footsteps(scene, walk)
    np.testing.assert_allclose([each.t for each in prints[2:]], steps.time_s)
    np.testing.assert_allclose(np.diff([each.x for each in prints[1:]]), steps.length_m)


def test_a_rigid_walk_keeps_its_legs():
    scene, start = LADDER["rigid"], jb.dynamics.rigid_state(START)
    walk = jb.rigid_walk(scene, start, footsteps=3, max_arrivals=3)
    found = recorded(scene, walk, start=start)
    strikes = np.asarray(walk.arrivals.t)
    assert [each.leg for each in found.footprints] == [2, 1, 2]
    t = np.array([0.1, strikes[0] + 0.1, strikes[1] + 0.2])
    states = jax.vmap(lambda time: jb.rigid_walk(scene, start, duration=time).final)(t)
    x, _, one, two = played(found, t)
    np.testing.assert_allclose(x, states.hip_x, rtol=0.0, atol=1e-5)
    swapped = np.array([False, True, False])
    np.testing.assert_allclose(one, np.where(swapped, states.theta_2, states.theta_1), atol=1e-5)
    np.testing.assert_allclose(two, np.where(swapped, states.theta_1, states.theta_2), atol=1e-5)
    # Legs go on where they were at an impact.
    assert np.abs(np.diff(found.channels["theta_1"])).max() < 0.05
    later = recorded(scene, walk)
    assert later.t[0] == strikes[0]
    assert later.t[-1] == found.t[-1]
    assert "elastic" not in found.channels  # nothing in it holds any
    # Even times are apart by a twentieth of the time in which a leg falls.
    assert np.diff(found.t).max() <= 0.05 * np.sqrt(0.4 / 9.8) * (1.0 + 1e-9)
    with pytest.raises(jb.ArgumentError, match="no heel strikes"):
        recorded(scene, jb.rigid_walk(scene, start, footsteps=3))


def test_what_cannot_be_viewed_is_told(seed_walk):
    scene, walk = seed_walk
    with pytest.raises(jb.ArgumentError, match="start is allowed only with a rigid walk"):
        jb.plot.view(scene, walk, start=jb.dynamics.rigid_state(START))
    end = jb.simulate(scene, START, duration=0.1, save="end")
    with pytest.raises(ValueError, match="There is no solution between"):
        jb.plot.view(scene, end)
    with pytest.raises(jb.ArgumentError, match="views"):
        jb.plot.side_by_side()
    with pytest.raises(jb.ArgumentError, match="views"):
        jb.plot.side_by_side(walk)


@pytest.mark.parametrize("name", ["coupled", "flat"])
def test_mechanisms_are_where_they_were(name):
    scene = scene_of(name)
    walk = jb.simulate(scene, start_of(name, scene), duration=0.1)
    found = recorded(scene, walk)
    sent = found.numbers()
    assert [part["name"] for part in sent["skeleton"]["parts"]] == list(
        scene.mechanism.structure.bodies
    )
    t = np.linspace(0.0, float(walk.t[-1]), 300)
    knots = found.t
    motion = {
        place: CubicHermiteSpline(knots, found.channels[place], found.channels[rate])(t)
        for place, rate in zip(*np.array_split(motion_names(scene.mechanism.structure), 2),
                               strict=True)
    }  # fmt: skip
    shown = found.skeleton.pose(motion, found.slope)
    there = poses(scene, DrawnMotion(scene, walk).at(t))
    for own, expected in zip((*shown.feet, *shown.centres), (*there.feet, *there.centres),
                             strict=True):  # fmt: skip
        np.testing.assert_allclose(own, expected, rtol=0.0, atol=2e-5)
    struck = jb.measure.heel_strikes(scene, walk)
    prints = [each for each in found.footprints if each.strike]
    assert [each.leg for each in prints] == struck.foot.tolist()
    normal = [found.channels[f"normal_{k + 1}"] for k in range(len(scene.mechanism.feet))]
    assert max(map(np.max, normal)) > 1.0

"""Mechanisms that roll and strike, against maximal coordinates with hinges as constraints."""

from collections import namedtuple

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped import Body, Coupling, Foot, Latch, Mechanism, Motor, Spring
from tests.mechanisms import FEET as STRAIGHT
from tests.mechanisms import LEGS, PAIR, SLOPE, TORSO, WALKERS, G, scene_of
from tests.random_mechanisms import arm, maximal_accelerations

Motion = namedtuple("Motion", "x z vx vz angles rates")
Place = namedtuple("Place", "along ahead")

floats = lambda low, high: st.floats(low, high, allow_subnormal=False)
places = st.one_of(floats(-0.2, 0.2), st.tuples(floats(-0.2, 0.2), floats(-0.2, 0.2)))
# Feet lie below the root point where all angles are 0.
hinges = st.one_of(floats(0.0, 0.2), st.tuples(floats(0.0, 0.2), floats(-0.2, 0.2)))


@st.composite
def walkers(draw):
    """Legs of one or two bodies, on the hip or on a pelvis, with torsos on springs or coupled."""
    number = lambda low, high: draw(floats(low, high))
    hangs = draw(st.sampled_from([None, "pelvis"]))
    bodies = []
    if hangs:
        bodies.append(Body("pelvis", mass=0.5, inertia=0.01, centre=draw(places)))
    joints = [Spring({"pelvis": 1, "vertical": -1}, stiffness=3.0, damping=0.1)] if hangs else []
    thigh = dict(mass=number(0.1, 1.0), inertia=number(0.002, 0.02), centre=draw(places))
    at = draw(hinges) if hangs else None
    bodies += [Body(f"a{i}", **thigh, parent=hangs, at=at) for i in (1, 2)]
    sole = dict(centre=number(0.2, 0.4), radius=draw(st.one_of(st.just(0.0), floats(0.01, 0.2))))
    outer = "a"
    if draw(st.booleans()):
        shank = dict(mass=number(0.1, 1.0), inertia=number(0.002, 0.02), centre=draw(places))
        knee = draw(hinges)
        bodies += [Body(f"b{i}", **shank, parent=f"a{i}", at=knee) for i in (1, 2)]
        joints += [Spring(f"b{i}", stiffness=2.0, damping=0.05, rest=0.2) for i in (1, 2)]
        joints += [Latch(f"b{i}", at=0.1, width=0.3, torque=0.2) for i in (1, 2)]
        outer = "b"
    torso = dict(mass=number(0.1, 2.0), inertia=number(0.002, 0.05), centre=draw(places))
    bodies.append(Body("torso", **torso, parent=hangs))
    angle = {"torso": 1, "a1": -0.5, "a2": -0.5}
    held = Spring(angle, stiffness=5.0, damping=0.2)
    joints.append(Coupling(angle) if draw(st.booleans()) else held)
    pairs = [("a1", "a2")] + ([("b1", "b2")] if outer == "b" else [])
    return Mechanism(
        root_mass=draw(st.one_of(st.none(), floats(0.1, 2.0))),
        bodies=bodies,
        feet=[Foot(f"{outer}{i}", **sole) for i in (1, 2)],
        joints=joints,
        mirror=pairs,
    )


def rigid(mechanism, actuation=None):
    return jb.RigidScene(mechanism, jb.Ground(slope=SLOPE, g=G), actuation)


def a_state(draw, scene):
    names = [name for name in scene.state()._fields if name != "mode"]
    values = draw(st.lists(floats(-1.0, 1.0), min_size=len(names), max_size=len(names)))
    return scene.state(**dict(zip(names, values, strict=True)))


def whole(scene, state):
    """Place of the root point, angles and rates of all bodies; a coupled torso bisects its legs."""
    structure = scene.mechanism.structure
    found = jb.dynamics.whole_state(scene, state)._asdict()

    def of_body(kind, body):
        """The state's own, or the mean of the thighs', which a coupled torso bisects."""
        bodies = [body] if f"{kind}_{body}" in found else ["a1", "a2"]
        return np.mean([found[f"{kind}_{name}"] for name in bodies])

    def of_bodies(kind):
        return tuple(of_body(kind, body) for body in structure.bodies)

    x, z = list(found.values())[:2]
    vx, vz = (found[name] for name in found if name.endswith(("_vx", "_vz")))
    return Motion(x, z, vx, vz, of_bodies("theta"), of_bodies("omega"))


def sole_of(scene, motion, number):
    """Body of a foot, its lowest point in the body's frame, and that point's velocity."""
    mechanism, s = scene.mechanism, scene.mechanism.structure
    body, foot = s.feet[number], mechanism.feet[number]
    centre = foot.centre
    radius = 0.0 if foot.radius is None else float(foot.radius)
    sine, cosine = np.sin(motion.angles[body]), np.cos(motion.angles[body])
    ahead = 0.0 if centre.ahead is None else float(centre.ahead)
    lowest = Place(float(centre.along) + radius * cosine, ahead - radius * sine)
    place = np.array([motion.x, motion.z], float)
    speed = np.array([motion.vx, motion.vz], float)
    chain = s.chains[body]
    for link, after in zip(chain, (*chain[1:], None), strict=True):
        point = lowest if after is None else mechanism.bodies[after].at
        if point is not None:
            moved, moves = arm(point, motion.angles[link])
            place, speed = place + moved, speed + moves * motion.rates[link]
    return body, lowest, place, speed


@settings(deadline=None, max_examples=8)
@given(st.data(), walkers())
def test_rolling_is_that_of_maximal_coordinates(data, mechanism):
    """Under the force on its foot every body moves so, and the foot's lowest point stays."""
    scene = rigid(mechanism)
    state = a_state(data.draw, scene)
    motion = whole(scene, state)
    body, lowest, place, speed = sole_of(scene, motion, 1)
    np.testing.assert_allclose([place[1], *speed], 0.0, atol=1e-13)
    found = jb.dynamics.rolling(scene, state)
    force = float(found.force.tangential), float(found.force.normal)
    moved = maximal_accelerations(mechanism, motion, SLOPE, G, [(body, lowest, *force)])
    scale = 1.0 + np.abs(moved).max()
    free = [2 + j for j in mechanism.structure.free]
    np.testing.assert_allclose(np.array(found[:-1]), moved[free], atol=1e-9 * scale)
    field = jb.dynamics.rolling_field(0.0, state, scene)
    assert type(field) is type(state)
    np.testing.assert_allclose(float(field[0]), motion.vx, rtol=1e-12, atol=1e-13)
    later = [
        np.array(a) + 1e-6 * np.array(b)
        for a, b in ((motion[4], motion[5]), (motion[5], moved[2:]), (motion[2:4], moved[:2]))
    ]
    after = Motion(motion.x, motion.z, *later[2], tuple(later[0]), tuple(later[1]))
    np.testing.assert_allclose(sole_of(scene, after, 1)[3] / 1e-6, 0.0, atol=1e-4 * scale)


@pytest.mark.parametrize("push", [False, True])
@settings(deadline=None, max_examples=5)
@given(st.data(), walkers())
def test_an_impact_is_that_of_maximal_coordinates(push, data, mechanism):
    """All that changes rates are the impulse on the foot that lands, and the push-off's."""
    scene = rigid(mechanism, jb.actuation.PushOff(0.2) if push else None)
    state = a_state(data.draw, scene)
    before, struck = whole(scene, state), jb.dynamics.impact(scene, state)
    s, n = mechanism.structure, len(mechanism.bodies)
    body, lowest, *_ = sole_of(scene, before, 0)
    forces = [(body, lowest, float(struck.impulse_x), float(struck.impulse_z))]
    if push:
        centre = np.array(_centre(scene, before))
        along = 0.2 * -centre / np.hypot(*centre)
        # On the root point, as a force on the pelvis or on a leg at its hinge.
        forces.append((s.children[-1][0], Place(0.0, None), *along))
    still = before._replace(vx=0.0, vz=0.0, rates=(0.0,) * n)
    gained = maximal_accelerations(mechanism, still, SLOPE, 0.0, forces)
    gained = gained - maximal_accelerations(mechanism, still, SLOPE, 0.0)
    after = whole(scene, struck.state)
    names = [s.body_twins[j] for j in range(n)]
    expected = np.array([before.vx, before.vz, *before.rates]) + gained
    got = np.array([after.vx, after.vz, *np.array(after.rates)[names]])
    scale = 1.0 + np.abs(gained).max()
    np.testing.assert_allclose(got, expected, atol=1e-9 * scale)
    np.testing.assert_allclose(np.array(after.angles)[names], before.angles, atol=1e-15)
    seen = after._replace(angles=before.angles, rates=tuple(np.array(after.rates)[names]))
    np.testing.assert_allclose(struck.lifting, _speed(scene, seen, 1), atol=1e-9 * scale)
    assert float(struck.state[0]) == float(state[0])


def _centre(scene, motion):
    """The standing foot's centre from the root point."""
    radius = scene.mechanism.feet[1].radius
    place = sole_of(scene, motion, 1)[2]
    return place[0] - motion.x, place[1] + (0.0 if radius is None else float(radius)) - motion.z


def _speed(scene, motion, number):
    return sole_of(scene, motion, number)[3][1]


@pytest.mark.parametrize("name", ["torso", "coupled"])
def test_kinetic_energy_is_the_compliant_walkers_and_push_off_works(name):
    """In the same motion."""
    scene = rigid(WALKERS[name], jb.actuation.PushOff(0.1))
    state = scene.state(theta_leg_1=0.2, theta_leg_2=-0.25, omega_leg_1=-0.3, omega_leg_2=-1.4)
    whole = jb.dynamics.whole_state(scene, state)
    ours, same = jb.dynamics.energies(scene, state), jb.dynamics.energies(scene_of(name), whole)
    assert float(ours.kinetic) == pytest.approx(float(same.kinetic), rel=1e-13)
    assert float(jb.dynamics.push_off_work(scene, state)) > 0.0


def test_states_are_named_by_the_mechanism():
    torso, coupled = (rigid(WALKERS[name]) for name in ("torso", "coupled"))
    assert torso.state(theta_torso=0.1)._fields == (
        "hip_x", "theta_leg_1", "theta_leg_2", "theta_torso",
        "omega_leg_1", "omega_leg_2", "omega_torso",
    )  # fmt: skip
    assert "theta_torso" not in coupled.state()._fields
    seed = jb.RigidScene(jb.seed_scene().walker, jb.Ground(slope=0.02))
    assert type(seed.state(theta_1=0.1)) is jb.dynamics.RigidState
    assert coupled.state(omega_leg_1=jnp.arange(3.0), standing="leg_2").hip_x.shape == (3,)


LEG = dict(mass=1.0, inertia=0.01, centre=0.1)
FEET = [Foot(f"leg_{i}", centre=0.3) for i in (1, 2)]


@pytest.mark.parametrize(
    ("words", "make"),
    [
        ("there must be two legs",
         lambda: rigid(Mechanism(bodies=(Body("leg_1", **LEG),), feet=FEET[:1]))),
        ("one leg stands, 'leg_1' or 'leg_2'",
         lambda: rigid(WALKERS["unequal"]).state(standing=["leg_1", "leg_2"])),
        ("hip_z", lambda: rigid(WALKERS["torso"]).state(hip_z=0.4)),
        ("theta_torso is not allowed", lambda: rigid(WALKERS["coupled"]).state(theta_torso=0.1)),
        ("the second of each pair stands, 'leg_2'",
         lambda: rigid(WALKERS["torso"]).state(standing="leg_1")),
        ("walker = 3", lambda: rigid(3)),
    ],
)  # fmt: skip
def test_what_rigid_feet_do_not_have_is_refused(words, make):
    with pytest.raises(jb.ArgumentError, match=words):
        make()


def test_a_motor_by_role_acts_as_the_spring_that_its_law_is():
    """Held to the vertical by a motor and by a spring, a torso moves alike."""
    angle = {"torso": 1, "vertical": -1}
    motor = Motor(angle, lambda motion: -3.0 * motion.angle - 0.2 * motion.rate)
    found = []
    for joint in (motor, Spring(angle, stiffness=3.0, damping=0.2)):
        scene = rigid(Mechanism(bodies=(*LEGS, TORSO), feet=STRAIGHT, joints=(joint,), mirror=PAIR))
        state = scene.state(
            theta_leg_1=-0.2, theta_leg_2=0.3, theta_torso=0.4, omega_leg_2=-1.0, omega_torso=2.0
        )
        found.append(np.array(jb.dynamics.rolling_field(0.0, state, scene)))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-12)
    assert abs(found[0][6]) > 1.0

"""Stops and flat feet on rigid feet, against maximal coordinates with what is held as loads."""

import dataclasses
import itertools
from types import SimpleNamespace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped import Body, Foot, Mechanism, Spring, Stop
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._equivalent_states import _turned
from jaxbiped.dynamics._holds import on_held
from jaxbiped.dynamics._minimal_motion import force_residual
from jaxbiped.dynamics._mode_changes import change_mode, foot_loads
from jaxbiped.dynamics._stance import Sole, either, stance_on
from jaxbiped.dynamics._stance_motion import turning_of
from jaxbiped.hybrid import Rolling
from jaxbiped.scene._bodies import Point
from jaxbiped.scene._joint_parts import HOLDS
from jaxbiped.scene._modes import Mode, _touch_within, rigid_modes
from tests.dynamics.test_rolling_mechanisms import (
    a_state,
    floats,
    hinges,
    places,
    rigid,
    sole_of,
    whole,
)
from tests.mechanisms import SLOPE, WALKERS, G
from tests.random_mechanisms import maximal_accelerations

HIP = {"thigh_1": 1, "thigh_2": -1}


@host_jit()
def held_by(scene, state):
    """Reactions of what is held."""
    return turning_of(scene, stance_on(scene, state, 1)).reactions


@host_jit()
def loads_of_feet(scene, state):
    stance = stance_on(scene, state, 1)
    return foot_loads(scene, stance, turning_of(scene, stance))


@host_jit()
def switches_of(scene, state):
    return [each.live for each in Rolling().switches(scene, state)]


@st.composite
def kneed(draw):
    """Two legs with knees, a torso on a spring; stops at the knees and between the thighs."""
    number = lambda low, high: draw(floats(low, high))
    thigh = dict(mass=number(0.1, 1.0), inertia=number(0.002, 0.02), centre=draw(places))
    shank = dict(mass=number(0.1, 1.0), inertia=number(0.002, 0.02), centre=draw(places))
    knee = draw(hinges)
    bodies = [Body(f"thigh_{i}", **thigh) for i in (1, 2)]
    bodies += [Body(f"shank_{i}", **shank, parent=f"thigh_{i}", at=knee) for i in (1, 2)]
    bodies.append(Body("torso", mass=number(0.1, 2.0), inertia=0.01, centre=draw(places)))
    sole = dict(centre=number(0.2, 0.4), radius=draw(st.one_of(st.none(), floats(0.01, 0.2))))
    holds = draw(st.sampled_from(HOLDS))
    joints = [Stop(f"shank_{i}", upper=3.0, lower=-3.0, holds=holds) for i in (1, 2)]
    joints += [
        Stop(HIP, upper=3.0, lower=-3.0),
        Spring({"torso": 1, "thigh_1": -0.5, "thigh_2": -0.5}, stiffness=5.0, damping=0.2),
    ]
    return Mechanism(
        root_mass=draw(st.one_of(st.none(), floats(0.1, 2.0))),
        bodies=bodies,
        feet=[Foot(f"shank_{i}", **sole) for i in (1, 2)],
        joints=joints,
        mirror=[("thigh_1", "thigh_2"), ("shank_1", "shank_2")],
    )


def in_mode(scene, state, held, stands=()):
    """A state in which these limits are held, by their numbers."""
    modes = rigid_modes(scene.mechanism)
    flags = tuple(np.bool_(i in held) for i in range(len(modes.limits)))
    mode = Mode(tuple(map(np.bool_, stands)), flags, (np.False_,) * len(modes.locks))
    return state._replace(mode=modes.encoded(np, mode, np.float64(0.0)))


def couples(scene, motion, limits, sizes):
    """The torques of limits as pairs of forces on the bodies that they turn."""
    forces = []
    for limit, size in zip(limits, sizes, strict=True):
        for body, weight in limit.gap.weights:
            across = np.array([np.cos(motion.angles[body]), np.sin(motion.angles[body])])
            torque = weight * float(size) * across
            forces += [(body, Point(1.0), *torque), (body, Point(0.0), *-torque)]
    return forces


@settings(deadline=None, max_examples=6)
@given(st.data(), kneed(), st.sampled_from([(), (0,), (0, 3), (1, 2, 4), (3, 5)]))
def test_held_angles_stay_under_the_torques_that_hold_them(data, mechanism, held):
    scene = rigid(mechanism)
    state = in_mode(scene, a_state(data.draw, scene), held)
    motion, reactions = whole(scene, state), held_by(scene, state)
    body, lowest, *_ = sole_of(scene, motion, 1)
    found = jb.dynamics.rolling(scene, state)
    limits = rigid_modes(mechanism).limits
    forces = [(body, lowest, float(found.force.tangential), float(found.force.normal))]
    forces += couples(scene, motion, limits, reactions)
    moved = maximal_accelerations(mechanism, motion, SLOPE, G, forces)
    scale = 1.0 + np.abs(moved).max()
    np.testing.assert_allclose(np.array(found[:-1]), moved[2:], atol=1e-9 * scale)
    for i, limit in enumerate(limits):
        along = limit.gap.of(moved[2:])
        assert (i in held) == (float(reactions[i]) != 0.0)
        assert i not in held or abs(along) < 1e-9 * scale


@settings(deadline=None, max_examples=3)
@given(st.data(), kneed(), st.sampled_from([(), (0,), (0, 2), (2, 4), (1, 3, 5)]))
def test_stops_take_part_in_an_impact_while_they_are_pressed(data, mechanism, held):
    """What is held is at rest afterwards; what is let go leaves, and no loose stop has pulled."""
    scene = rigid(mechanism)
    state = in_mode(scene, a_state(data.draw, scene), held)
    limits, s = rigid_modes(mechanism).limits, mechanism.structure
    before = whole(scene, state)
    rates = np.array(before.rates)
    for i in held:  # a held angle is at rest before, too
        row = np.zeros(len(rates))
        for j, weight in limits[i].gap.weights:
            row[j] = weight
        rates = rates - row * (row @ rates) / (row @ row)
    names = [f"omega_{name}" for name in s.bodies]
    state = state._replace(**dict(zip(names, map(np.float64, rates), strict=True)))
    before, struck = whole(scene, state), jb.dynamics.impact(scene, state)
    after = whole(scene, struck.state)
    twins = list(s.body_twins)
    seen = np.array(after.rates)[twins]
    # The impulses of the limits, from what neither the ground nor they leave.
    still = before._replace(vx=0.0, vz=0.0, rates=(0.0,) * len(rates))
    body, lowest, *_ = sole_of(scene, before, 0)
    ground = [(body, lowest, float(struck.impulse_x), float(struck.impulse_z))]
    free = maximal_accelerations(mechanism, still, SLOPE, 0.0)
    given_ = maximal_accelerations(mechanism, still, SLOPE, 0.0, ground) - free
    columns = [
        maximal_accelerations(mechanism, still, SLOPE, 0.0, couples(scene, still, [limit], [1.0]))
        - free
        for limit in limits
    ]
    change = np.array([after.vx, after.vz, *seen]) - [before.vx, before.vz, *rates]
    impulses = np.linalg.lstsq(
        np.array([columns[i] for i in held]).T if held else np.zeros((len(change), 1)),
        change - given_,
    )[0]
    still = np.zeros(len(change))
    rebuilt = given_ + sum((p * columns[i] for i, p in zip(held, impulses, strict=False)), still)
    scale = 1.0 + np.abs(change).max()
    np.testing.assert_allclose(change, rebuilt, atol=1e-8 * scale)
    stood = s.stance_leg
    for i, impulse in zip(held, impulses, strict=False):
        limit, rate = limits[i], limits[i].gap.of(seen)
        locked = limit.locks and (limit.leg != stood or limit.holds == HOLDS[2])
        if locked:
            assert abs(rate) < 1e-8 * scale
        else:
            assert impulse > -1e-8 * scale
            assert rate > -1e-8 * scale
            assert min(abs(rate), abs(impulse)) < 1e-8 * scale


HEEL_TOE = WALKERS["flat"]


@pytest.mark.parametrize("flat", [True, False])
def test_what_is_held_lies_flat_and_at_rest(flat):
    """A foot that is nearly flat and turns slowly, where both of its ends are told to stand; one
    step of Newton's method leaves the cube of 2 mrad."""
    scene = rigid(HEEL_TOE)
    state = scene.state(theta_leg_1=-0.3, theta_foot_2=2e-3, omega_foot_2=-0.1, omega_leg_2=-1.0)
    state = in_mode(scene, state, (), stands=(True, flat))
    held = host_jit()(on_held)(scene, state)
    expected = {"theta_foot_2": 0.0, "omega_foot_2": 0.0} if flat else {}
    for name, value in (state._asdict() | expected).items():
        assert float(getattr(held, name)) == pytest.approx(float(value), abs=8e-9), name


@settings(deadline=None, max_examples=6)
@given(st.data())
def test_a_flat_foot_is_pressed_at_both_ends(data):
    """Forces on heel and toe turn and carry all bodies as the flat foot does."""
    scene = rigid(HEEL_TOE)
    state = a_state(data.draw, scene)
    state = state._replace(theta_foot_2=np.float64(0.0), omega_foot_2=np.float64(0.0))
    state = in_mode(scene, state, (), stands=(True, True))
    motion, found = whole(scene, state), jb.dynamics.rolling(scene, state)
    heel, toe = loads_of_feet(scene, state)
    along = float(found.force.tangential)
    forces = []
    for number, load, tangential in ((2, heel, along), (3, toe, 0.0)):
        body, lowest, *_ = sole_of(scene, motion, number)
        forces.append((body, lowest, tangential, float(load)))
    moved = maximal_accelerations(HEEL_TOE, motion, SLOPE, G, forces)
    scale = 1.0 + np.abs(moved).max()
    np.testing.assert_allclose(np.array(found[:-1]), moved[2:], atol=1e-9 * scale)
    assert abs(moved[2 + HEEL_TOE.structure.bodies.index("foot_2")]) < 1e-9 * scale


def hsu_chen(holds="through heel strike"):
    """Hsu Chen's walker, with other latches at its knees."""
    scene = jb.models.hsu_chen()
    return dataclasses.replace(scene, walker=dataclasses.replace(scene.walker, holds=holds))


ANGLES = dict(theta_thigh_1=-0.2, theta_shank_1=-0.2, theta_thigh_2=0.2, theta_shank_2=0.2)
RATES = dict(omega_thigh_2=-1.1, omega_shank_2=-1.1)


def test_the_mode_is_in_the_state():
    """The same angles and rates with a free and with a held knee differ by it alone."""
    scene = hsu_chen()
    one = scene.state(**ANGLES, **RATES, standing="shank_2", held="shank_2")
    both = scene.state(**ANGLES, **RATES, standing="shank_2", held=("shank_1", "shank_2"))
    assert one[:-1] == both[:-1]
    assert one.mode != both.mode
    assert scene.state(**ANGLES, **RATES).mode == both.mode
    assert scene.state(**ANGLES, **RATES, held=()).mode == 0.0
    assert scene.state(**ANGLES | {"theta_shank_1": -0.3}, **RATES).mode == one.mode


@pytest.mark.parametrize(
    ("words", "changed"),
    [
        ("passes the stop 'shank_1'", dict(theta_shank_1=-0.1)),
        ("held = 'shank_1' is not allowed", dict(theta_shank_1=-0.3, held="shank_1")),
        ("held = 'shank_1' is not allowed", dict(omega_shank_1=-0.3, held="shank_1")),
        ("held = 'knee'", dict(held="knee")),
        ("the second of each pair stands", dict(standing="shank_1")),
    ],
)
def test_states_that_no_mode_allows_are_refused(words, changed):
    with pytest.raises(jb.ArgumentError, match=words):
        hsu_chen().state(**ANGLES | RATES | changed)


def test_mirrored_stops_on_one_body_keep_their_names():
    parts = dict(mass=1.0, inertia=0.01)
    bodies = [Body(f"leg_{i}", **parts, centre=0.1) for i in (1, 2)]
    feet = [Foot(f"leg_{i}", centre=0.3) for i in (1, 2)]
    torso = Body("torso", **parts, centre=-0.1)

    def scene_of(names):
        stops = [
            Stop({"torso": 1, f"leg_{i}": -1}, upper=0.2, name=name)
            for i, name in zip((1, 2), names, strict=True)
        ]
        mirror = [("leg_1", "leg_2")]
        return rigid(Mechanism(bodies=[*bodies, torso], feet=feet, joints=stops, mirror=mirror))

    named, angles = scene_of(("back", "front")), dict(theta_torso=0.2)
    modes = [named.state(**angles, held=held).mode for held in ("back", "front")]
    assert modes[0] != modes[1]
    apart = jb.parameter_names(rigid(named.mechanism.untied()))
    assert {"torso.back.upper", "torso.front.upper"} <= set(apart)
    assert "torso.back.upper" in jb.parameter_names(named)
    with pytest.raises(jb.ArgumentError, match="that of several stops"):
        scene_of((None, None)).state(**angles, held="torso")


def test_the_hip_moves_as_the_leg_that_stands_carries_it():
    """A leg with a knee and a straight one, whose feet hang at the ends of unlike chains."""
    parts = dict(mass=0.5, inertia=0.01, centre=0.2)
    scene = rigid(
        Mechanism(
            bodies=(
                Body("thigh", **parts),
                Body("shank", **parts, parent="thigh", at=0.5),
                Body("leg", **parts),
            ),
            feet=(Foot("shank", centre=0.5), Foot("leg", centre=0.99)),
        )
    )
    angles = dict(theta_thigh=0.1, theta_shank=-0.05, theta_leg=-0.2)
    rates = dict(omega_thigh=-1.0, omega_shank=-0.5, omega_leg=0.3)
    thigh, shank = 0.5 * np.exp(0.1j), 0.5 * np.exp(-0.05j)
    leg = 0.99 * np.exp(-0.2j)
    # Along each link from its hinge: cosine down the normal, sine ahead; the hip moves against it.
    expected = {
        "shank": (thigh + shank, 1j * (-1.0 * thigh - 0.5 * shank)),
        "leg": (leg, 0.3j * leg),
    }
    for foot, (place, moves) in expected.items():
        found = jb.dynamics.whole_state(scene, scene.state(**angles, **rates, standing=foot))
        told = (found.hip_z, found.hip_vz, found.hip_vx)
        np.testing.assert_allclose(told, (place.real, moves.real, -moves.imag), atol=1e-15)


def test_what_locks_lies_within_one_leg():
    with pytest.raises(jb.ArgumentError, match="does not lie within one leg"):
        rigid(
            Mechanism(
                bodies=[Body(f"thigh_{i}", mass=1.0, inertia=0.01, centre=0.1) for i in (1, 2)],
                feet=[Foot(f"thigh_{i}", centre=0.3) for i in (1, 2)],
                joints=[Stop(HIP, upper=0.6, lower=-0.6, holds=HOLDS[1])],
                mirror=[("thigh_1", "thigh_2")],
            )
        )


def test_a_locked_knee_is_held_with_either_sign_and_a_pressed_one_is_let_go():
    """A swing knee at its limit whose shank is swung back by gravity: the lock pulls."""
    back = ANGLES | dict(theta_thigh_1=-0.6, theta_shank_1=-0.6)
    modes = {}
    for holds in HOLDS:
        scene = hsu_chen(holds)
        state = scene.state(**back, **RATES, held=("shank_1", "shank_2"))
        modes[holds] = [bool(each) for each in switches_of(scene, state)][2:]
        after = change_mode(scene, state)
        still = float(after.mode) == float(state.mode)
        pull = float(held_by(scene, state)[0])
        assert pull < 0.0
        assert still == (holds != HOLDS[0])
    assert modes[HOLDS[0]] == [True, True]
    assert modes[HOLDS[1]] == [False, False]


def doubled(legs):
    """Hsu Chen's walker, with a second stop of the same limit at the knees of some legs."""
    given = hsu_chen("while pressed").mechanism.arguments()
    more = [Stop(f"shank_{i}", upper=part.upper, name="more")
            for i, part in enumerate(given["joints"], 1) if i in legs]  # fmt: skip
    walker = Mechanism(**given | {"joints": (*given["joints"], *more)})
    return dataclasses.replace(hsu_chen(), walker=walker)


def test_two_stops_of_one_limit_hold_as_one_does():
    """Only the sum of their reactions is determined."""
    one, both = hsu_chen("while pressed"), doubled((1, 2))
    stood, twice = (scene.state(**ANGLES, **RATES) for scene in (one, both))
    moved, doubly = (
        jb.dynamics.rolling_field(0.0, *each) for each in ((stood, one), (twice, both))
    )
    np.testing.assert_allclose(doubly[:-1], moved[:-1], rtol=1e-12)
    struck, again = (jb.dynamics.impact(*each) for each in ((one, stood), (both, twice)))
    np.testing.assert_allclose(again.state[:-1], struck.state[:-1], rtol=1e-12)
    np.testing.assert_allclose(again[1:], struck[1:], rtol=1e-12)


@pytest.mark.parametrize(
    ("radius", "ahead", "side_by_side"),
    [(0.05, 0.03, False), (0.05, 0.02, True), (0.05, 0.04, True), (0.02, 0.0, False),
     (0.02, 1e-3, True), (None, 0.0, False), (None, 0.03, True)],
)  # fmt: skip
def test_two_feet_that_stand_on_one_point_are_refused(radius, ahead, side_by_side):
    """Circles of 2 cm and others, one that touches from within, and points."""
    legs = [Body(f"leg_{i}", mass=1.0, inertia=0.01, centre=0.1) for i in (1, 2)]
    first = None if radius is None else 0.02
    feet = [
        Foot(f"leg_{i}", centre=place, radius=size, name=name)
        for i in (1, 2)
        for name, place, size in (("heel", 0.3, first), ("toe", (0.3, ahead), radius))
    ]
    walker = Mechanism(bodies=legs, feet=feet, mirror=(("leg_1", "leg_2"),))
    if side_by_side:
        assert jb.RigidScene(walker, jb.Ground(slope=SLOPE)).state() is not None
    else:
        with pytest.raises(jb.ArgumentError, match=r"feet leg_1\.heel and leg_1\.toe are not all"):
            jb.RigidScene(walker, jb.Ground(slope=SLOPE))


@pytest.mark.parametrize("height", [1e-3, 1.0, 1e3])
def test_whether_two_feet_stand_on_one_point_does_not_depend_on_the_walkers_size(height):
    def touch(apart, radius=0.0):
        """Whether circles so many heights apart do, of which one has a radius."""
        feet = Foot("a", centre=-apart * height, radius=radius * height), Foot("a", centre=0.0)
        return bool(_touch_within(SimpleNamespace(height=height), *feet))

    assert touch(1e-5)
    assert not touch(1e-4)
    assert touch(1.0, radius=1.0)
    assert not touch(1.0, radius=0.5)


def test_forces_are_left_over_by_the_inertia_of_rates_that_are_not_the_motions():
    """F − M ẏ: nothing at the motion's own rates, and M times what is taken off them."""
    random = np.random.default_rng(1)
    scene = jb.seed_scene(slope=0.2, hip_mass=0.3)
    state = jb.State(*map(jnp.asarray, (0.0, 0.36, -0.3, 0.2, 1.0, -0.5, 3.0, -2.0)))
    rates = jb.dynamics.vector_field(0.0, state, scene)
    off = jb.State(*map(jnp.asarray, random.normal(size=8)))
    moved = jax.tree.map(jnp.subtract, rates, off)
    at_rates, beside = (
        np.array([each[i] for i in range(4, 8)])
        for each in (force_residual(scene, state, rates), force_residual(scene, state, moved))
    )
    np.testing.assert_allclose(at_rates, 0.0, atol=1e-9)
    walker = scene.walker
    md, inertia = walker.m * walker.d, walker.J + walker.m * walker.d**2
    (x, z), turns, angles = off[4:6], off[6:8], state[2:4]
    expected = [
        walker.total_mass * x + sum(md * np.cos(a) * w for a, w in zip(angles, turns, strict=True)),
        walker.total_mass * z + sum(md * np.sin(a) * w for a, w in zip(angles, turns, strict=True)),
        *(
            md * (np.cos(a) * x + np.sin(a) * z) + inertia * w
            for a, w in zip(angles, turns, strict=True)
        ),
    ]
    np.testing.assert_allclose(beside, expected, rtol=1e-9)


ENTRIES = {"along": (0.3, 0.2), "ahead": (0.05, -0.1), "radius": (0.02, 0.01)}
KNOWN = list(itertools.product([True, False], repeat=2))
"""Whether the first sole has an entry, and whether the second one does: what is none is zero."""


def sole(which, known):
    numbers = {name: jnp.asarray(pair[which]) for name, pair in ENTRIES.items()}
    numbers |= {name: None for name, has in known.items() if not has[which]}
    return Sole(1, 3, Point(numbers["along"], numbers["ahead"]), numbers["radius"])


@pytest.mark.parametrize("first_stands", [True, False])
@pytest.mark.parametrize("ahead", KNOWN)
@pytest.mark.parametrize("radius", KNOWN)
def test_of_two_soles_the_entries_are_those_of_the_one_that_stands(ahead, radius, first_stands):
    known = {"along": (True, True), "ahead": ahead, "radius": radius}
    one, other = sole(0, known), sole(1, known)
    found = either(jnp.asarray(first_stands), one, other)
    stands = one if first_stands else other
    assert (found.leg, found.body) == (1, 3)
    for here, there in zip(
        (found.centre.along, found.centre.ahead, found.radius),
        (stands.centre.along, stands.centre.ahead, stands.radius),
        strict=True,
    ):
        assert float(0.0 if here is None else here) == float(0.0 if there is None else there)


class Wheel(NamedTuple):
    """A wheel's orientation by Euler parameters and their rates."""

    cos_half_wheel: float
    sin_half_wheel: float
    cos_rate_wheel: float
    sin_rate_wheel: float


def wheel(angle, rate):
    """cos θ/2 and sin θ/2, and how they change."""
    cosine, sine = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return Wheel(cosine, sine, -0.5 * rate * sine, 0.5 * rate * cosine)


@pytest.mark.parametrize("times", [0, 1, 3, -2])
def test_a_wheel_that_is_turned_has_the_euler_parameters_of_the_larger_angle(times):
    ends = [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)]
    mechanism = Mechanism(
        bodies=(Body("wheel", mass=1.0, inertia=0.5, centre=0.0),),
        feet=[Foot("wheel", centre=end, leg=f"spoke_{k}") for k, end in enumerate(ends)],
        turn={"wheel": 4},
    )
    state = Wheel(*map(jnp.asarray, wheel(0.3, -1.7)))
    found = _turned(mechanism.structure, state, times)
    expected = wheel(0.3 + times * 0.5 * np.pi, -1.7)._asdict()
    assert {name: float(value) for name, value in found.items()} == pytest.approx(expected)

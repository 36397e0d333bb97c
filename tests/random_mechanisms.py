"""Mechanisms and motions drawn by hypothesis, and their accelerations in maximal coordinates."""

import numpy as np
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped.scene._bodies import Body, Foot
from jaxbiped.scene._joint_parts import Coupling, Latch, Spring, Stop
from jaxbiped.scene._mechanism import Mechanism


def _numbers(low, high):
    return st.floats(low, high, allow_subnormal=False)


_PLACES = st.one_of(_numbers(-0.4, 0.4), st.tuples(_numbers(-0.4, 0.4), _numbers(-0.4, 0.4)))


@st.composite
def mechanisms(draw, most_bodies=10):
    """Trees of up to ten bodies, with springs, stops, latches and couplings."""
    n = draw(st.integers(1, most_bodies))
    bodies = []
    for j in range(n):
        parent = None if j == 0 else draw(st.sampled_from([None, *(f"b{i}" for i in range(j))]))
        bodies.append(
            Body(
                f"b{j}",
                mass=draw(_numbers(0.1, 2.0)),
                inertia=draw(_numbers(0.005, 0.1)),
                centre=draw(_PLACES),
                parent=parent,
                at=None if parent is None else draw(st.one_of(st.none(), _PLACES)),
            )
        )
    joints = [Spring("b0", stiffness=3.0, damping=0.2, rest=0.1)]
    last = f"b{n - 1}"
    if n > 1:
        joints += [
            Spring({last: 1, "vertical": -1}, stiffness=2.0),
            Latch({last: 1, "b0": -1}, at=0.1, width=0.3, torque=0.7, damping=0.1),
            Stop(
                {last: 1, "normal": -1},
                upper=0.1,
                lower=-0.2,
                law=jb.laws.HuntCrossley(K=20.0, hysteresis=0.5, n=1.5),
            ),
        ]
    for k in range(draw(st.integers(0, min(2, n - 1)))):
        others = st.sampled_from(["vertical", *(f"b{i}" for i in range(k + 1, n))])
        led = draw(st.lists(others, min_size=1, max_size=2, unique=True))
        weights = {f"b{k}": 1} | {name: -1 / len(led) for name in led}
        joints.append(Coupling(weights, rest=draw(_numbers(-0.5, 0.5))))
    root_mass = draw(st.one_of(st.none(), _numbers(0.1, 2.0)))
    return Mechanism(
        root_mass=root_mass, bodies=bodies, feet=[Foot("b0", centre=0.1)], joints=joints
    )


def motions(mechanism):
    """Places and rates of the free coordinates."""
    n = 2 + len(mechanism.structure.free)
    return st.tuples(
        st.lists(_numbers(-2.0, 2.0), min_size=n, max_size=n),
        st.lists(_numbers(-3.0, 3.0), min_size=n, max_size=n),
    )


def arm(place, angle):
    """A point of a body from its hinge, and the point's derivative with respect to the angle."""
    along, ahead = float(place.along), 0.0 if place.ahead is None else float(place.ahead)
    s, c = np.sin(angle), np.cos(angle)
    return (
        np.array([along * s + ahead * c, -along * c + ahead * s]),
        np.array([along * c - ahead * s, along * s + ahead * c]),
    )


def maximal_accelerations(mechanism, motion, slope, g, forces=()):
    """Accelerations of the root point and of all angles, each body with three coordinates.

    The hinges and the couplings are constraints, solved with the equations of motion. `forces` are
    (body, place, x, z).
    """
    s, bodies = mechanism.structure, mechanism.bodies
    n = len(bodies)
    size = 2 + 3 * n  # root point, then each body's mass centre and angle
    mass, load = np.zeros((size, size)), np.zeros(size)
    gravity = g * np.array([np.sin(slope), -np.cos(slope)])
    root = 1.0 if mechanism.root_mass is None else float(mechanism.root_mass)
    mass[0, 0] = mass[1, 1] = 0.0 if mechanism.root_mass is None else root
    load[:2] = mass[0, 0] * gravity
    rows, right = [], []

    def constrain(pairs, value):
        row = np.zeros(size)
        for place, weight in pairs:
            row[place] += weight
        rows.append(row)
        right.append(value)

    for j, body in enumerate(bodies):
        at, angle, rate = 2 + 3 * j, float(motion.angles[j]), float(motion.rates[j])
        mass[at, at] = mass[at + 1, at + 1] = float(body.mass)
        mass[at + 2, at + 2] = float(body.inertia)
        load[at : at + 2] = float(body.mass) * gravity
        place, moves = arm(body.centre, angle)
        parent = s.parents[j]
        for i in range(2):
            # Mass centre minus its own arm is the hinge, on the parent or on the root point.
            pairs = [(at + i, 1.0), (at + 2, -moves[i])]
            value = -place[i] * rate**2
            if parent < 0:
                pairs.append((i, -1.0))
            else:
                up = 2 + 3 * parent
                above, turning = float(motion.angles[parent]), float(motion.rates[parent])
                own, own_moves = arm(bodies[parent].centre, above)
                hinge, hinge_moves = (np.zeros(2), np.zeros(2))
                if body.at is not None:
                    hinge, hinge_moves = arm(body.at, above)
                pairs += [(up + i, -1.0), (up + 2, own_moves[i] - hinge_moves[i])]
                value += (own - hinge)[i] * turning**2
            constrain(pairs, value)
    for angle, part in zip(s.joints, mechanism.joints, strict=True):
        if isinstance(part, Coupling):
            constrain([(4 + 3 * j, weight) for j, weight in angle.weights], 0.0)
            continue
        torque = _torque(part, angle, motion, slope)
        for j, weight in angle.weights:
            load[4 + 3 * j] += weight * torque
    for j, place, x, z in forces:
        own, _ = arm(bodies[j].centre, float(motion.angles[j]))
        point, _ = arm(place, float(motion.angles[j]))
        lever = point - own
        load[2 + 3 * j : 4 + 3 * j] += x, z
        load[4 + 3 * j] += lever[0] * z - lever[1] * x
    jacobian = np.array(rows)
    whole = np.block([[mass, jacobian.T], [jacobian, np.zeros((len(rows), len(rows)))]])
    found = np.linalg.solve(whole, np.concatenate([load, right]))
    return np.concatenate([found[:2], found[4:size:3]])


def _torque(part, angle, motion, slope):
    value = sum(w * float(motion.angles[j]) for j, w in angle.weights) + angle.vertical * slope
    rate = sum(w * float(motion.rates[j]) for j, w in angle.weights)
    numbers = {
        name: None if getattr(part, name, None) is None else float(getattr(part, name))
        for name in ("stiffness", "damping", "rest", "at", "width", "torque", "upper", "lower")
    }
    damping = (numbers["damping"] or 0.0) * rate
    if isinstance(part, Spring):
        return -(numbers["stiffness"] or 0.0) * (value - (numbers["rest"] or 0.0)) - damping
    if isinstance(part, Latch):
        u = (value - numbers["at"]) / numbers["width"]
        return -numbers["torque"] * u * np.exp((1 - u * u) / 2) - damping * np.exp(-u * u / 2)

    def pushed(depth, speed):
        law = part.law
        if depth <= 0.0:
            return 0.0
        elastic = float(law.K) * depth ** float(law.n)
        return max(elastic * (1.0 + float(law.hysteresis) * speed), 0.0)

    return -pushed(value - numbers["upper"], rate) + pushed(numbers["lower"] - value, -rate)

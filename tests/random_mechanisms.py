"""Mechanisms and motions drawn by hypothesis, and their accelerations in maximal coordinates."""

import numpy as np
from hypothesis import strategies as st
from reference import mechanism_equations as maximal
from reference.mechanism_equations import accelerations

import jaxbiped as jb
from jaxbiped import Body, Coupling, Foot, Latch, Mechanism, Spring, Stop
from tests.mechanism_numbers import bodies_of


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

    `forces` are (body, place, x, z).
    """
    tree = bodies_of(mechanism, slope, g)
    moving = np.array(motion.angles, float), np.array(motion.rates, float)
    torques = [
        (angle.weights, _torque(part, angle, motion, slope))
        for angle, part in zip(mechanism.structure.joints, mechanism.joints, strict=True)
        if not isinstance(part, Coupling)
    ]
    pushed = [
        (j, arm(place, float(motion.angles[j]))[0], np.array([x, z], float))
        for j, place, x, z in forces
    ]
    root = np.zeros(2)  # where it is and how it moves does not count
    return accelerations(tree, maximal.Motion(root, root, *moving), tree.p, pushed, torques)


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

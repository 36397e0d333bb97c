"""Mechanisms to walk with, their starts, and their walks in maximal coordinates."""

import numpy as np
from scipy.integrate import solve_ivp

import jaxbiped as jb
from jaxbiped.dynamics._tree import Motion
from jaxbiped.scene._bodies import Body, Foot, Point
from jaxbiped.scene._joint_parts import Coupling, Latch, Spring, Stop
from jaxbiped.scene._mechanism import Mechanism
from tests.random_mechanisms import arm, maximal_accelerations

SLOPE, G = 0.03, 9.8
V0, XI = 0.1, 10.0
LAWS = dict(
    normal=jb.laws.HuntCrossley(K=2e5, hysteresis=0.8, n=1.5),
    friction=jb.laws.BengisuAkay(0.5, 0.4, V0, XI),
)
LEGS = tuple(Body(f"leg_{i}", mass=1.0, inertia=0.0096, centre=0.10) for i in (1, 2))
FEET = tuple(Foot(f"leg_{i}", centre=0.32, radius=0.08) for i in (1, 2))
PAIR = (("leg_1", "leg_2"),)
TORSO = Body("torso", mass=0.3, inertia=0.0015, centre=-0.10)
BISECTING = {"torso": 1, "leg_1": -0.5, "leg_2": -0.5}
KNEE = jb.laws.HuntCrossley(K=30.0, hysteresis=0.3, n=1.0)


def leg(i, m_thigh=0.2, turning=1.0):
    """A thigh on the hip and a shank on it, of McGeer's proportions but for their inertias."""
    return (
        Body(f"thigh_{i}", mass=m_thigh, inertia=5.8e-4 * turning, centre=0.080),
        Body(
            f"shank_{i}",
            mass=0.124,
            inertia=6.9e-4 * turning,
            centre=(0.096, -0.004),
            parent=f"thigh_{i}",
            at=0.184,
        ),
    )


_SLOW_LEGS = (*leg(1, turning=10.0), *leg(2, turning=10.0))


def _of_both(make):
    return tuple(make(i) for i in (1, 2))


KNEES = (("thigh_1", "thigh_2"), ("shank_1", "shank_2"))
WALKERS = {
    "unequal": Mechanism(
        bodies=(LEGS[0], Body("leg_2", mass=1.2, inertia=0.01, centre=0.11)), feet=FEET
    ),
    "torso": Mechanism(
        bodies=(*LEGS, TORSO),
        feet=FEET,
        joints=(Spring(BISECTING, stiffness=16.0, damping=0.1),),
        mirror=PAIR,
    ),
    "coupled": Mechanism(
        bodies=(*LEGS, TORSO), feet=FEET, joints=(Coupling(BISECTING),), mirror=PAIR
    ),
    "kneed": Mechanism(
        root_mass=1.352,
        bodies=_SLOW_LEGS,
        feet=_of_both(lambda i: Foot(f"shank_{i}", centre=0.136, radius=0.08)),
        joints=_of_both(lambda i: Stop(f"shank_{i}", upper=0.0, lower=-0.4, law=KNEE)),
        mirror=KNEES,
    ),
    "flat": Mechanism(
        bodies=(
            *LEGS,
            *_of_both(
                lambda i: Body(
                    f"foot_{i}", mass=0.1, inertia=2e-3, centre=0.02, parent=f"leg_{i}", at=0.36
                )
            ),
        ),
        feet=tuple(
            Foot(f"foot_{i}", centre=(0.03, place), radius=0.01, name=name)
            for i in (1, 2)
            for place, name in ((-0.04, "heel"), (0.08, "toe"))
        ),
        joints=_of_both(lambda i: Spring(f"foot_{i}", stiffness=8.0, damping=0.05)),
        mirror=(("leg_1", "leg_2"), ("foot_1", "foot_2")),
    ),
    "five": Mechanism(
        root="pelvis",
        bodies=(Body("trunk", mass=2.0, inertia=0.02, centre=-0.15), *_SLOW_LEGS),
        feet=_of_both(lambda i: Foot(f"shank_{i}", centre=0.18)),
        joints=(
            Spring({"trunk": 1, "vertical": -1}, stiffness=5.0, damping=0.2),
            *_of_both(lambda i: Spring(f"shank_{i}", stiffness=2.0, damping=0.02)),
            *_of_both(
                lambda i: Latch({f"thigh_{i}": 1, "trunk": -1}, at=0.0, width=0.3, torque=0.3)
            ),
        ),
        mirror=KNEES,
    ),
}
"""By name: what walks in every test of mechanisms."""

_STRAIGHT = dict(theta_leg_1=-0.25, theta_leg_2=0.17, omega_leg_2=-1.3, hip_vx=0.52, hip_vz=0.06)
_STARTS = {
    "unequal": _STRAIGHT,
    "torso": _STRAIGHT | dict(theta_torso=-0.04),
    "coupled": _STRAIGHT,
    "kneed": dict(
        theta_thigh_1=-0.1, theta_shank_1=-0.3, theta_thigh_2=0.1, theta_shank_2=0.1, hip_vx=0.3
    ),
    "flat": dict(
        theta_leg_1=-0.2, theta_foot_1=-0.2, theta_leg_2=0.2, theta_foot_2=0.2, omega_leg_2=-1.2
    ),
    "five": dict(theta_thigh_1=-0.3, theta_shank_1=-0.4, theta_thigh_2=0.2, pelvis_vx=0.3),
}


def scene_of(name, **changes):
    """A walker of `WALKERS` on a slope."""
    given = dict(walker=WALKERS[name], ground=jb.Ground(slope=SLOPE, g=G), **LAWS)
    return jb.Scene(**(given | changes))


def start_of(name, scene):
    """Its start, the lowest foot just touching."""
    return scene.state(**_STARTS[name])


def walk_in_maximal_coordinates(mechanism, state, duration):
    """Root point, angles and rates after a while, by SciPy: (2 + bodies) places, then rates.

    Each body has coordinates of its own, held together by constraints; the laws of contact are
    written here anew from their papers' formulas.
    """
    structure, n = mechanism.structure, len(mechanism.bodies)
    places = _with_fixed(structure, state, structure.coordinates)
    rates = _with_fixed(structure, state, structure.rates)

    def slopes(_, y):
        motion = Motion(y[0], y[1], y[2 + n], y[3 + n], tuple(y[2 : 2 + n]), tuple(y[4 + n :]))
        forces = _contact_forces(mechanism, motion)
        found = maximal_accelerations(mechanism, motion, SLOPE, G, forces)
        return np.concatenate([y[2 + n :], found])

    start = np.concatenate([places, rates])
    ends = solve_ivp(slopes, (0.0, duration), start, method="DOP853", rtol=1e-10, atol=1e-12)
    return ends.y[:, -1]


def _with_fixed(structure, state, names):
    """Places or rates of the root point and all bodies; couplings here rest at 0."""
    values = np.zeros(2 + len(structure.bodies))
    given = [float(getattr(state, name)) for name in names]
    values[:2] = given[:2]
    values[[2 + j for j in structure.free]] = given[2:]
    for each in structure.fixed:
        values[2 + each.body] = sum(w * values[2 + j] for j, w in each.angle.weights)
    return values


def _contact_forces(mechanism, motion):
    structure, found = mechanism.structure, []
    for j, foot in zip(structure.feet, mechanism.feet, strict=True):
        at, speed = np.array([motion.x, motion.z]), np.array([motion.vx, motion.vz])
        chain = structure.chains[j]
        for link, after in zip(chain, (*chain[1:], None), strict=True):
            place = foot.centre if after is None else mechanism.bodies[after].at
            if place is not None:
                point, moves = arm(place, motion.angles[link])
                at, speed = at + point, speed + moves * motion.rates[link]
        radius = 0.0 if foot.radius is None else float(foot.radius)
        depth, into = radius - at[1], -speed[1]
        if depth <= 0.0:
            continue
        normal = max(2e5 * depth**1.5 * (1.0 + 0.8 * into), 0.0)
        slip = speed[0] + radius * motion.rates[j]
        sole = _sole(foot.centre, radius, motion.angles[j])
        found.append((j, sole, _friction(normal, slip), normal))
    return found


def _sole(centre, radius, angle):
    """The lowest point of a foot's circle in its body's frame."""
    ahead = 0.0 if centre.ahead is None else float(centre.ahead)
    s, c = np.sin(angle), np.cos(angle)
    return Point(float(centre.along) + radius * c, ahead - radius * s)


def _friction(normal, slip):
    u = abs(slip) / V0
    share = 0.5 * u * (2.0 - u) if u < 1.0 else 0.4 + 0.1 * np.exp(-XI * (abs(slip) - V0))
    return -normal * share * np.sign(slip)

"""Mechanisms to walk with, and their starts."""

import dataclasses

import jaxbiped as jb
from jaxbiped import Body, Coupling, Foot, Latch, Mechanism, Spring, Stop

SLOPE, G = 0.03, 9.8
LAWS = dict(
    normal=jb.laws.HuntCrossley(K=2e5, hysteresis=0.8, n=1.5),
    friction=jb.laws.BengisuAkay(0.5, 0.4, 0.1, 10.0),
)
LEGS = tuple(Body(f"leg_{i}", mass=1.0, inertia=0.0096, centre=0.10) for i in (1, 2))
FEET = tuple(Foot(f"leg_{i}", centre=0.32, radius=0.08) for i in (1, 2))
PAIR = (("leg_1", "leg_2"),)
TORSO = Body("torso", mass=0.3, inertia=0.0015, centre=-0.10)
BISECTING = {"torso": 1, "leg_1": -0.5, "leg_2": -0.5}
KNEE = jb.laws.HuntCrossley(K=30.0, hysteresis=0.3, n=1.0)


def seed_walker(*bodies, joints=(), first=None):
    """The seed's walker as data, with more on its hip; with a first leg of another mass unlike."""
    masses = {"1": 1.0 if first is None else first, "2": 1.0}
    legs = [Body(name, mass=m, inertia=0.0096, centre=0.10) for name, m in masses.items()]
    return Mechanism(
        bodies=(*legs, *bodies),
        feet=tuple(Foot(name, centre=0.32, radius=0.08) for name in masses),
        joints=joints,
        mirror=(("1", "2"),) if first is None else (),
    )


SEED_WITH_TORSO = dataclasses.replace(
    jb.seed_scene(),
    walker=seed_walker(
        Body("torso", mass=0.5, inertia=0.004, centre=-0.08),
        joints=(Spring("torso", stiffness=8.0, damping=0.3),),
    ),
)


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

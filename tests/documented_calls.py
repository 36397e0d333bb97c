"""Calls as pages write them, which mypy reads with the package's own modules.

Constructors convert numbers, pairs, names, lists and mappings, so annotations must let them in.
"""

import jaxbiped as jb


def mechanism() -> jb.Mechanism:
    """The walker of the pages on mechanisms, with every part that converts what it is given."""
    bodies = [
        jb.Body("leg_1", mass=1.0, inertia=0.01, centre=0.1),
        jb.Body("leg_2", mass=1.0, inertia=0.01, centre=(0.1, 0.0)),
        jb.Body("torso", mass=0.5, inertia=0.01, centre=-0.1),
        jb.Body("head", mass=0.1, inertia=0.001, centre=-0.1, parent="torso", at=-0.3),
    ]
    feet = [
        jb.Foot("leg_1", centre=0.3, radius=0.1),
        jb.Foot("leg_2", centre=(0.3, 0.0), radius=0.1),
    ]
    between = {"leg_1": 1, "leg_2": -1}
    joints = [
        jb.Spring(between, stiffness=1.0),
        jb.Spring("head", stiffness=5.0, damping=0.1),
        jb.Coupling({"torso": 1.0, "leg_1": -0.5, "leg_2": -0.5}),
        jb.Motor(between, law=jb.actuation.PD(kp=1.0, of=between)),
    ]
    return jb.Mechanism(root="hip", bodies=bodies, feet=feet, joints=joints)


def scenes() -> list[jb.Scene | jb.RigidScene | jb.RedundantScene]:
    """Scenes with one actuator, several, and a method by its name."""
    seed, spring = jb.seed_scene(), jb.actuation.HipSpring(k=0.1)
    rigid = jb.RigidScene(seed.walker, jb.Ground(slope=0.02), spring)
    spline = jb.actuation.HipSpline(torque=[0.1, 0.2], first=-0.2, last=0.2)
    driven = jb.Scene(
        seed.walker, seed.ground, seed.normal, seed.friction, actuation=[spring, spline]
    )
    one_leg = jb.Scene(
        seed.walker, seed.ground, seed.normal, seed.friction, clearance=jb.laws.OneFoot(1)
    )
    return [rigid, driven, one_leg, jb.RedundantScene(seed, "baumgarte")]

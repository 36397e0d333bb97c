"""Eight walkers whose mechanisms differ: their scenes, and starts near their gaits."""

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import jaxbiped as jb

SIDES = (1, 2)
PRESSED = 1e-6
"""Depth of the foot that stands at a start [m]: at 0 it is open whether it touches."""


class Case(NamedTuple):
    """A walker to try, and a start near its gait.

    Attributes:
        scene: the walker on its slope.
        start: angles and rates by the names of the state; the others are 0.
        standing: the body whose foot stands at that start.
        rigid: what of the start is another on rigid feet, where feet lie flat and stops are hard.
    """

    scene: jb.Scene
    start: dict[str, float]
    standing: str
    rigid: Mapping[str, float] = MappingProxyType({})

    @property
    def guess(self) -> Any:
        """The start as a state, its standing foot pressed into the ground."""
        state = self.scene.state(**self.start, standing=self.standing)
        height = f"{self.scene.mechanism.structure.root}_z"
        return state._replace(**{height: getattr(state, height) - PRESSED})

    def on_rigid_feet(self) -> tuple[jb.RigidScene, Any]:
        """The same walker on rigid feet, and the start there."""
        scene = jb.RigidScene(self.scene.walker, self.scene.ground)
        return scene, scene.state(**self.start | dict(self.rigid))


def scene_with(walker: Any, slope: float, **parts: Any) -> jb.Scene:
    """A walker on a slope, with the seed's laws of contact and the walker's own clearance."""
    seed = jb.seed_scene(slope=slope)
    given = dict(walker=walker, ground=seed.ground, normal=seed.normal, friction=seed.friction)
    return jb.Scene(**(given | parts))


def kneed(**changes: Any) -> jb.Kneed:
    """McGeer's proportions of 1990, for a leg of 0.4 m and a mass of 2 kg; its knees lock."""
    locking = {"holds": "until heel strike"} | changes
    return dataclasses.replace(jb.models.mcgeer(knees=True).walker, **locking)


def unequal_legs() -> jb.Mechanism:
    """The seed's two legs, one of them heavier by a fiftieth."""
    return jb.Mechanism(
        bodies=tuple(jb.Body(n, mass=m, inertia=0.0096, centre=0.1) for n, m in _UNEQUAL.items()),
        feet=tuple(jb.Foot(n, centre=0.32, radius=0.08) for n in _UNEQUAL),
    )


_UNEQUAL = {"1": 1.02, "2": 1.0}


def with_torso(spring: jb.Spring | None = None) -> jb.WithTorso:
    """The seed's legs below a torso, which bisects them exactly unless a spring holds it."""
    return jb.WithTorso(jb.seed_scene().walker, m_torso=0.3, J_torso=0.0015, h=0.1, spring=spring)


def flat_feet() -> jb.Mechanism:
    """The seed's legs on flat feet, which springs at the ankles hold square to them."""
    legs = (jb.Body(f"leg_{i}", mass=1.0, inertia=0.0096, centre=0.10) for i in SIDES)
    feet = (
        jb.Body(
            f"foot_{i}", mass=0.1, inertia=2e-4, centre=(0.02, 0.02), parent=f"leg_{i}", at=0.36
        )
        for i in SIDES
    )
    return jb.Mechanism(
        bodies=(*legs, *feet),
        feet=tuple(
            jb.Foot(f"foot_{i}", centre=(0.03, ahead), radius=0.01, name=name)
            for i in SIDES
            for name, ahead in (("heel", -0.02), ("toe", 0.04))
        ),
        joints=tuple(jb.Spring(f"foot_{i}", stiffness=8.0, damping=0.2) for i in SIDES),
        mirror=(("leg_1", "leg_2"), ("foot_1", "foot_2")),
    )


def five_links() -> jb.Mechanism:
    """The kneed walker with a torso, which motors at the hip of the standing leg hold upright."""
    upright = jb.actuation.PD(kp=4.0, kd=0.4, of={"torso": 1, "normal": -1})
    below = kneed().mechanism().arguments()
    torso = jb.Body("torso", mass=0.3, inertia=0.0015, centre=-0.1)
    hip = jb.Motor({"torso": 1, "thigh_2": -1}, upright)
    return jb.Mechanism(
        **below | {"bodies": (torso, *below["bodies"]), "joints": (*below["joints"], hip)}
    )


def cases() -> dict[str, Case]:
    """The eight, by the names that tables have."""
    legs = dict(clearance=jb.laws.StanceRotation())
    bisecting = {"torso": 1, "1": -0.5, "2": -0.5}
    spring = jb.Spring(bisecting, stiffness=16.0, damping=0.1)
    light = jb.WithTorso(kneed(hip_mass=1.252), m_torso=0.1, J_torso=2e-4, h=0.05)
    stepping = dict(theta_1=0.1, omega_1=2.3, omega_2=-0.69)
    leaning = stepping | dict(theta_torso=0.05, omega_torso=0.8)
    bent = dict(
        theta_thigh_1=0.14, theta_shank_1=-0.20, omega_thigh_1=3.4, omega_shank_1=1.7,
        theta_thigh_2=-0.086, theta_shank_2=0.118, omega_thigh_2=-0.88, omega_shank_2=-0.88,
    )  # fmt: skip
    at_stop = dict(theta_shank_2=0.114)
    return {
        "seed": Case(jb.seed_scene(slope=0.02), stepping, "2"),
        "unequal legs": Case(scene_with(unequal_legs(), 0.02, **legs), stepping, "2"),
        "torso on a spring": Case(scene_with(with_torso(spring), 0.02, **legs), leaning, "2"),
        "torso coupled": Case(scene_with(with_torso(), 0.02, **legs), stepping, "2"),
        "kneed": Case(scene_with(kneed(), 0.0456), bent, "shank_2", at_stop),
        "kneed with torso": Case(scene_with(light, 0.0456), bent, "shank_2", at_stop),
        "flat feet": Case(
            scene_with(flat_feet(), 0.03, **legs),
            dict(
                theta_leg_1=0.183,
                theta_foot_1=0.180,
                omega_leg_1=1.97,
                omega_foot_1=1.98,
                theta_leg_2=-0.028,
                theta_foot_2=0.004,
                omega_leg_2=-0.75,
                omega_foot_2=-0.05,
            ),
            "foot_2",
            rigid=dict(theta_foot_2=0.0, omega_foot_2=0.0),
        ),
        "five links": Case(scene_with(five_links(), 0.0456), bent, "shank_2", at_stop),
    }

"""Laws of motors and actuators at random motions against themselves at mirror images of these."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.mechanisms import BISECTING, FEET, LEGS, PAIR, TORSO

PD = jb.actuation.PD


def walker(*laws, angles=(BISECTING,), coupled=False):
    """A torso on two legs that are mirror images, with motors by side."""
    motors = [jb.Motor(angle, law, by="side") for angle, law in zip(angles, laws, strict=True)]
    couplings = (jb.Coupling(BISECTING),) if coupled else ()
    return jb.Mechanism(bodies=(*LEGS, TORSO), feet=FEET, joints=(*motors, *couplings), mirror=PAIR)


def reading(first, second):
    return PD(kp=6.0, kd=0.6, of={"torso": 1, "leg_1": -first, "leg_2": -second})


def test_a_law_on_an_angle_that_is_its_own_image():
    walker(reading(0.5, 0.5))
    with pytest.raises(jb.ArgumentError, match=r"N m at its image by the mirror, which is not"):
        walker(reading(0.2, 0.8))
    # Within a hundredth of the range alone.
    with pytest.raises(jb.ArgumentError, match="image by the mirror"):
        walker(lambda m: jnp.where(m.of("leg_1")[0] > 0.9, 1e-3, 0.0) - m.rate)


def test_laws_on_angles_that_are_each_others_images():
    own = [{"torso": 1, f"leg_{i}": -1} for i in (1, 2)]
    for alike in (lambda m: -m.angle, PD(kp=1.0), PD(kp=1.0, of="torso")):
        walker(alike, alike, angles=own)
    for unlike in (PD(kp=1.0, of="leg_1"), lambda m: -m.angle + 1e-3 * m.of("leg_2")[1]):
        with pytest.raises(jb.ArgumentError, match=r"Motor\(.*'torso'.* by the mirror"):
            walker(unlike, unlike, angles=own)


def test_motions_are_those_that_couplings_allow():
    # On the bisecting torso, twice its angle is the sum of the legs'.
    law = lambda m: m.of("torso")[0] ** 2 + (2.0 * m.of("torso")[0] - m.of("leg_1")[0]) ** 2
    even = lambda m: law(m) + m.of("leg_1")[0] ** 2
    walker(even, angles=({"leg_1": 0.5, "leg_2": 0.5, "normal": -1},), coupled=True)
    with pytest.raises(jb.ArgumentError, match="image by the mirror"):
        walker(law, angles=({"leg_1": 0.5, "leg_2": 0.5, "normal": -1},), coupled=True)


def test_laws_of_a_wheel_know_no_spoke():
    def on_a_wheel(law, count=6):
        turns = [2.0 * np.pi * k / count for k in range(count)]
        feet = [
            jb.Foot("wheel", centre=(np.cos(t), np.sin(t)), leg=f"spoke_{k}", name=f"foot_{k}")
            for k, t in enumerate(turns)
        ]
        return jb.Mechanism(
            bodies=(jb.Body("wheel", mass=1.0, inertia=0.5, centre=0.0), TORSO),
            feet=feet,
            joints=(jb.Motor({"torso": 1, "normal": -1}, law),),
            turn={"wheel": count},
        )

    on_a_wheel(lambda m: -m.angle - 0.1 * m.of("wheel")[1] + jnp.sin(6.0 * m.of("wheel")[0]))
    with pytest.raises(jb.ArgumentError, match="image by the turn"):
        on_a_wheel(lambda m: -m.angle - 0.1 * m.of("wheel")[0])


def test_numbers_that_are_traced_are_not_compared():
    slope = jax.grad(lambda kp: walker(PD(kp=kp, of="leg_1")).total_mass * kp)(1.0)
    assert float(slope) == pytest.approx(float(walker(PD(kp=1.0)).total_mass))
    with pytest.raises(jb.ArgumentError, match="image by the mirror"):
        jax.grad(lambda x: walker(reading(0.2, 0.8)).total_mass * x)(1.0)


class Lame(jb.actuation.AbstractHipActuator):
    """A damper that feels one leg alone; `both`, its twin too."""

    b: float = jb.laws.parameter("damping", unit="N m s/rad")
    both: bool = dataclasses.field(default=False, metadata={"static": True})

    def torques(self, hip):
        torque = -self.b * (hip.rate[0] - (hip.rate[1] if self.both else 0.0))
        return torque, -torque

    def motor_torques(self, hip):
        return None

    def idle(self):
        return dataclasses.replace(self, b=0.0 * self.b)


@pytest.mark.parametrize("scene", [jb.seed_scene(), jb.ladder()["rigid"]])
def test_an_actuator_at_the_hip(scene):
    dataclasses.replace(scene, actuation=Lame(0.1, both=True))
    with pytest.raises(jb.ArgumentError, match=r"Lame gives .* by the mirror"):
        dataclasses.replace(scene, actuation=Lame(0.1))


def test_a_scene_is_checked_again_when_its_law_reads_something_else():
    shares = [0.5, 0.5]
    scene = jb.RigidScene(
        walker(lambda m: -shares[0] * m.of("leg_1")[0] - shares[1] * m.of("leg_2")[0]),
        jb.Ground(slope=0.03),
    )
    start = scene.state(omega_leg_2=-1.2)
    shares[0] = 0.2
    with pytest.raises(jb.ArgumentError, match="image by the mirror"):
        jb.rigid_walk(scene, start, duration=0.1)


class Reluctant(jb.laws.AbstractClearance):
    """A rule that one leg obeys as in the paper, and another at its own rates."""

    leg: str = eqx.field(static=True)
    rate: float

    def admits(self, leg, leg_rate):
        return leg_rate < (self.rate if leg == self.leg else 0.0)


class OneLegScuffs(jb.laws.StanceRotation):
    """The paper's rule for one leg, and none for the other."""

    def admits(self, leg, leg_rate):
        return None if leg == "1" else super().admits(leg, leg_rate)


@pytest.mark.parametrize("formulation", ["minimal", "redundant"])
def test_a_clearance_rule_that_knows_a_leg_has_no_step(formulation):
    scene, state = jb.seed_scene(), jb.seed_state()
    rules = {"Reluctant": Reluctant("1", -0.2), "OneFoot": jb.laws.OneFoot(1)}
    rules["OneLegScuffs"] = OneLegScuffs()
    for name, rule in rules.items():
        kept = dataclasses.replace(scene, clearance=rule)
        if formulation == "redundant":
            kept = jb.RedundantScene(kept)
        for door in (jb.find_gait, jb.return_map):
            with pytest.raises(jb.ArgumentError, match=f"= {name} admits leg '1' and leg '2'"):
                door(kept, state)
    alike = dataclasses.replace(scene, clearance=Reluctant("1", 0.0))
    jax.eval_shape(lambda y: jb.return_map(alike, y), state)

"""Joint parts: energies against integrals of torques by SciPy, couplings against their angles."""

import numpy as np
import pytest
from scipy.integrate import quad

import jaxbiped as jb
from jaxbiped import Coupling, Latch, Mechanism, Spring, Stop
from tests.mechanisms import FEET, LEGS, TORSO, scene_of

HIP = {"leg_1": 1, "leg_2": -1}
RATE = 0.7
LAW = jb.laws.HuntCrossley(K=20.0, hysteresis=0.5, n=1.5)


def by_latch(angle):
    u = (angle - 0.1) / 0.3
    return -0.5 * np.exp(0.5) * u * np.exp(-0.5 * u * u)


def by_stop(angle):
    return -20.0 * max(angle - 0.2, 0.0) ** 1.5 + 20.0 * max(-0.4 - angle, 0.0) ** 1.5


PARTS = {
    "spring": (Spring(HIP, stiffness=2.0, damping=0.3, rest=0.1), lambda a: -2.0 * (a - 0.1), 0.1),
    "latch": (Latch(HIP, at=0.1, width=0.3, torque=0.5), by_latch, 0.1),
    "stop": (Stop(HIP, upper=0.2, lower=-0.4, law=LAW), by_stop, 0.0),
}
"""Each with its torque where it is at rest, and an angle at which it stores nothing."""
ALOFT = 1.0
"""Height of the hip at which no foot touches [m]."""


def in_the_air(*joints):
    """A walker of two legs with these joints between them."""
    return scene_of("torso", walker=Mechanism(bodies=LEGS, feet=FEET, joints=joints))


@pytest.mark.parametrize("angle", [-0.6, 0.0, 0.5])
@pytest.mark.parametrize("name", list(PARTS))
def test_joints_store_the_work_that_their_torques_do(name, angle):
    """What a damper takes is lost, and so is what a stop's law adds with the rate."""
    part, torque, rest = PARTS[name]
    scene = in_the_air(part)
    state = scene.state(hip_z=ALOFT, theta_leg_1=angle, omega_leg_1=RATE)
    power = jb.dynamics.powers(scene, state)
    stored, _ = quad(torque, angle, rest, epsabs=1e-13, points=[0.2, -0.4])
    assert float(jb.dynamics.energies(scene, state).elastic) == pytest.approx(
        stored, rel=1e-9, abs=1e-12
    )
    lost = 0.3 * RATE**2 if name == "spring" else 0.0
    if name == "stop":
        into = RATE if angle > 0.0 else -RATE
        lost = 0.5 * into * abs(torque(angle)) * into
    assert float(power.damper) == pytest.approx(lost, rel=1e-12, abs=1e-13)
    assert float(power.indentation) == pytest.approx(lost - torque(angle) * RATE, rel=1e-12)


def test_joints_without_elastic_parts_have_no_energy():
    scene = in_the_air()
    state = scene.state(hip_z=ALOFT, theta_leg_1=0.5, omega_leg_1=RATE)
    assert float(jb.dynamics.energies(scene, state).elastic) == 0.0
    assert float(jb.dynamics.powers(scene, state).indentation) == 0.0


def test_a_coupling_keeps_its_angle_at_rest():
    """φ = θ_torso − θ_1/2 − slope/2 is 0.3 whatever the legs do, and does not turn: the energies
    are those of a walker whose torso is free and moves so."""
    coupling = Coupling({"torso": 1, "leg_1": -0.5, "vertical": -0.5}, rest=0.3)
    legs = dict(hip_z=ALOFT, theta_leg_1=0.2, theta_leg_2=-0.7, omega_leg_1=0.2, omega_leg_2=-0.7)
    torso = dict(theta_torso=0.3 + 0.5 * 0.2 + 0.5 * 0.1, omega_torso=0.5 * 0.2)
    found = []
    for joints, angles in (((coupling,), legs), ((), legs | torso)):
        walker = Mechanism(bodies=(*LEGS, TORSO), feet=FEET, joints=joints)
        scene = scene_of("torso", walker=walker, ground=jb.Ground(slope=0.1))
        found.append(jb.dynamics.energies(scene, scene.state(**angles)))
    np.testing.assert_allclose(*found, rtol=1e-14)

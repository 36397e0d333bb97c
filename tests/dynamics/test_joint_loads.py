"""Joint parts: energies against integrals of torques by SciPy, couplings against their angles."""

import numpy as np
import pytest
from scipy.integrate import quad

import jaxbiped as jb
from jaxbiped.dynamics._joint_loads import joint_energy, motion_of
from jaxbiped.dynamics._tree import Motion
from jaxbiped.scene._joint_parts import Coupling, Latch, Spring, Stop
from jaxbiped.scene._mechanism import Mechanism
from tests.mechanisms import FEET, LEGS, TORSO

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


@pytest.mark.parametrize("angle", [-0.6, 0.0, 0.5])
@pytest.mark.parametrize("name", list(PARTS))
def test_joints_store_the_work_that_their_torques_do(name, angle):
    """What a damper takes is lost, and so is what a stop's law adds with the rate."""
    part, torque, rest = PARTS[name]
    mechanism = Mechanism(root_mass=1.0, bodies=LEGS, feet=FEET, joints=(part,))
    zero = np.float64(0.0)
    angles, rates = (np.float64(angle), zero), (np.float64(RATE), zero)
    found = joint_energy(mechanism, Motion(*[zero] * 4, angles, rates), 0.02, stops=True)
    stored, _ = quad(torque, angle, rest, epsabs=1e-13, points=[0.2, -0.4])
    assert float(found.stored) == pytest.approx(stored, rel=1e-9, abs=1e-12)
    lost = 0.3 * RATE**2 if name == "spring" else 0.0
    if name == "stop":
        into = RATE if angle > 0.0 else -RATE
        lost = 0.5 * into * abs(torque(angle)) * into
    assert float(found.lost) == pytest.approx(lost, rel=1e-12, abs=1e-13)
    assert float(found.taken) == pytest.approx(lost - torque(angle) * RATE, rel=1e-12)


def test_joints_without_elastic_parts_have_no_energy():
    mechanism = Mechanism(root_mass=1.0, bodies=LEGS, feet=FEET)
    zero = np.float64(0.0)
    motion = Motion(*[zero] * 4, (zero, zero), (zero, zero))
    assert joint_energy(mechanism, motion, 0.02, stops=True) is None


def test_a_coupling_keeps_its_angle_at_rest():
    """φ = θ_torso − θ_1/2 − slope/2 is 0.3 whatever the legs do, and does not turn."""
    coupling = Coupling({"torso": 1, "leg_1": -0.5, "vertical": -0.5}, rest=0.3)
    walker = Mechanism(bodies=(*LEGS, TORSO), feet=FEET, joints=(coupling,))
    given = [np.float64(x) for x in (0.0, 0.4, 0.2, -0.7)]
    found = motion_of(walker, jb.Ground(slope=0.1), given, given)
    assert float(found.angles[2]) == pytest.approx(0.3 + 0.5 * 0.2 + 0.5 * 0.1, rel=1e-15)
    assert float(found.rates[2]) == pytest.approx(0.5 * 0.2, rel=1e-15)
    assert [float(x) for x in found.angles[:2]] == [0.2, -0.7]

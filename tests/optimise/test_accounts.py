"""Accounts of the mechanisms' walkers on both kinds of feet: energies are conserved, objectives are
what is measured along a walk, and what nothing drives costs the slope's sine."""

import dataclasses

import numpy as np
import pytest
from _mechanisms import cases

import jaxbiped as jb
from jaxbiped.optimise._objective_values import evaluate
from tests.mechanisms import BISECTING, FEET, LEGS, PAIR

pytestmark = pytest.mark.slow

A = jb.actuation
CASES = cases()
DRIVES = {
    "rigid": (A.HipPulse(0.02, phase=0.05), A.PushOff(0.05)),
    "compliant": (A.HipPulse(0.02, phase=0.05), A.FootPreload(extension=2e-4)),
}
"""By the kind of feet what drives any walker that has a pair of legs, beside its own motors."""
EVERYTHING = jb.Mechanism(
    bodies=(*LEGS, jb.Body("torso", mass=0.5, inertia=0.003, centre=-0.15)),
    feet=FEET,
    joints=(
        jb.Motor({"torso": 1, "leg_2": -1}, A.PD(4.0, 0.4, 0.03, {"torso": 1, "vertical": -1})),
        jb.Spring(BISECTING, stiffness=2.0, damping=0.05),
        jb.Latch({"leg_1": 1, "leg_2": -1}, width=0.2, torque=0.02, damping=0.003),
    ),
    mirror=PAIR,
)
"""A torso that a motor and a spring with a damper hold, and a latch with another one."""
LEANING = dict(
    theta_leg_1=-0.272, theta_leg_2=0.272, theta_torso=0.073,
    omega_leg_1=-0.95, omega_leg_2=-1.56, omega_torso=-0.25,
)  # fmt: skip
WORKS = ("gravity_work", "actuation_work", "motor_work")
LOSSES = {
    "rigid": ("impact_loss", "joint_loss", "stop_loss"),
    "compliant": ("damper_loss", "friction_loss"),
}
HOW = dict(radius_sensitivities=False, engine="lanes")


def on_feet(name, feet):
    return CASES[name].on_rigid_feet() if feet == "rigid" else CASES[name][:1] + (CASES[name].guess,)


def driven(scene, feet):
    """The scene with drives where its walker has legs for them to turn."""
    parts = DRIVES[feet] if scene.mechanism.structure.pairs else DRIVES[feet][1:]
    return dataclasses.replace(scene, actuation=parts)


def booked(scene, start, footsteps):
    """Ledgers between the heel strikes of a walk: works and losses by name, residuals, costs."""
    if isinstance(scene, jb.RigidScene):
        how = dict(footsteps=footsteps, max_arrivals=footsteps, accuracy="tight")
        walk = jb.rigid_walk(scene, start, **how)
        return jb.measure.rigid_ledger(scene, walk), jb.measure.cost_of_transport(scene, walk)
    walk = jb.simulate(scene, start, footsteps=footsteps + 1, accuracy="tight", engine="lanes")
    ends = jb.measure.heel_strikes(scene, walk).time_s[:footsteps]
    if len(ends) < 2:
        return jb.measure.energy_ledger(scene, walk), None
    cost = jb.measure.cost_of_transport(scene, walk, ends)
    return jb.measure.energy_ledger(scene, walk, ends), cost


def assert_closed(scene, start):
    """What of the energy is left open is below 1e-6 of the ledger's largest flow."""
    books, _ = booked(scene, start, 3)
    flows = [value for name, value in books._asdict().items() if name.endswith(("work", "loss"))]
    assert len(books.residual) >= 1
    assert np.all(np.abs(books.residual) < 1e-6 * np.abs(flows).max(axis=0))
    return books


def assert_told(scene, start, accuracy):
    """Objectives are what is measured over a cycle, and all that is given is lost."""
    rigid = isinstance(scene, jb.RigidScene)
    gait = jb.find_gait(scene, start, accuracy=accuracy, **HOW)
    assert gait.outcome is jb.gait.Search.FOUND
    names = ("cost_of_transport", "impact_loss", "friction_loss", "motor_work")
    names = [name for name in names if jb.optimise.OBJECTIVES[name].lacks(scene) is None]
    told = evaluate(scene, gait, names, accuracy).values
    cycle = len(gait.step_lengths)
    books, cost = booked(scene, gait.measures.state, cycle + 1)
    sums = {name: float(np.sum(value[:cycle])) for name, value in books._asdict().items()}
    motors, weight = float(np.sum(cost.motor_work[:cycle])), float(scene.mechanism.total_mass) * 9.8
    measured = {
        "cost_of_transport": (motors + sums["gravity_work"]) / (weight * cost.distance[:cycle].sum()),
        "impact_loss": sum(sums[name] for name in LOSSES["rigid" if rigid else "compliant"][: 3 if rigid else 1]),
        "friction_loss": sums.get("friction_loss"),
        "motor_work": motors,
    }
    near = 1e-7 if accuracy == "tight" else 1e-5
    for name in names:
        assert told[name] == pytest.approx(measured[name], rel=near, abs=1e-9), name
    given = weight * float(gait.measures.step_length) * np.sin(float(scene.ground.slope))
    lost = told["impact_loss"] + told.get("friction_loss", 0.0)
    assert lost == pytest.approx(given + sums["actuation_work"], rel=near)
    if "motor_work" not in told:
        sine = np.sin(float(scene.ground.slope))
        assert told["cost_of_transport"] == sine
        assert measured["cost_of_transport"] == pytest.approx(sine, rel=near)
    return told

"""Accounts of walkers on both kinds of feet, against conservation, walks and the slope's sine.

Of each mechanism of the matrix, energies are conserved, objectives are what is measured along a
walk, and what nothing drives costs the sine of the slope.
"""

import dataclasses

import numpy as np
import pytest
from _mechanisms import cases

import jaxbiped as jb
from tests.mechanisms import BISECTING, FEET, LEGS, PAIR
from tests.optimise.evaluations import evaluated, named_costs_of

pytestmark = pytest.mark.slow

A = jb.actuation
CASES = cases()
PUSHES = {"unequal legs": 0.05, "kneed": 0.3, "kneed with torso": 0.3, "five links": 0.3}
"""Impulses [N s] by which some mechanisms reach the second heel strike on all grounds."""


def drives_of(name, feet):
    """What drives a mechanism of the matrix, beside its own motors; at the hip with a mirror."""
    hip = (A.HipPulse(0.02, phase=0.05),) if CASES[name].scene.mechanism.structure.pairs else ()
    if feet == "rigid":
        return (*hip, A.PushOff(PUSHES.get(name, 0.2)))
    return (*hip, A.FootPreload(extension=2e-4))


UPRIGHT = {"torso": 1, "vertical": -1}
EVERYTHING = jb.Mechanism(
    bodies=(*LEGS, jb.Body("torso", mass=0.5, inertia=0.003, centre=-0.15)),
    feet=FEET,
    joints=(
        jb.Motor({"torso": 1, "leg_2": -1}, A.PD(4.0, 0.4, 0.03, of=UPRIGHT)),
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
LOSSES = ("impact_loss", "joint_loss", "stop_loss", "damper_loss")
"""What ledgers of either kind have of what the objective `impact_loss` is."""
GROUNDS = {"its slope": None, "level": 0.0, "uphill": -0.01}
HOW = dict(radius_sensitivities=False, engine="lanes")


def on_feet(name, feet):
    """A mechanism of the matrix on its slope, and a start."""
    case = CASES[name]
    return case.on_rigid_feet() if feet == "rigid" else (case.scene, case.guess)


def booked(scene, start, footsteps):
    """Ledger and costs between the first heel strikes of a walk; of one that has none the whole."""
    if isinstance(scene, jb.RigidScene):
        how = dict(footsteps=footsteps, max_arrivals=footsteps, accuracy="tight")
        walk = jb.rigid_walk(scene, start, **how)
        return jb.measure.rigid_ledger(scene, walk), jb.measure.cost_of_transport(scene, walk)
    walk = jb.simulate(scene, start, footsteps=footsteps + 1, accuracy="tight", engine="lanes")
    ends = jb.measure.heel_strikes(scene, walk).time_s[:footsteps]
    if len(ends) < 2:
        return jb.measure.energy_ledger(scene, walk), None
    costs = jb.measure.cost_of_transport(scene, walk, ends)
    return jb.measure.energy_ledger(scene, walk, ends), costs


def assert_closed(books):
    """What of the energy is left open is below 1e-6 of a ledger's largest flow."""
    flows = [value for name, value in books._asdict().items() if name.endswith(("work", "loss"))]
    assert len(books.residual) > 0
    assert np.all(np.abs(books.residual) < 1e-6 * np.abs(flows).max(axis=0))


def objectives_of(scene, start, accuracy):
    """A gait, and its objectives by name."""
    gait = jb.find_gait(scene, start, accuracy=accuracy, **HOW)
    names = ("cost_of_transport", "impact_loss", "friction_loss", "motor_work")
    known = jb.optimise.OBJECTIVES | jb.optimise.NAMED_COSTS
    names = [name for name in names if known[name].lacks(scene) is None]
    values = evaluated(scene, gait, names, accuracy).values
    return gait, {name: values[name] for name in names}


def assert_told(scene, gait, told, near):
    """Objectives of a gait are what is measured over a cycle, and all that is given is lost."""
    assert gait.outcome is jb.gait.Search.FOUND
    cycle = len(gait.step_lengths)
    books, costs = booked(scene, gait.measures.state, cycle + 1)
    assert_closed(books)
    sums = {
        name: value[:cycle].sum() for name, value in (books._asdict() | costs._asdict()).items()
    }
    weight, sine = scene.mechanism.total_mass * scene.ground.g, np.sin(scene.ground.slope)
    given = sums["motor_work"] + sums["gravity_work"]
    measured = {
        "cost_of_transport": given / (weight * sums["distance"]),
        "impact_loss": sum(sums.get(name, 0.0) for name in LOSSES),
        "friction_loss": sums.get("friction_loss"),
        "motor_work": sums["motor_work"],
    }
    for name in told:
        assert told[name] == pytest.approx(float(measured[name]), rel=near, abs=1e-3 * near), name
    fallen = float(weight * gait.measures.step_length * sine)
    lost = told["impact_loss"] + told.get("friction_loss", 0.0)
    assert lost == pytest.approx(fallen + sums["actuation_work"], rel=near)
    if "motor_work" not in told:
        assert told.get("cost_of_transport", sine) == pytest.approx(float(sine), rel=1e-15)
        assert float(measured["cost_of_transport"]) == pytest.approx(float(sine), rel=near)


def test_a_walker_that_is_driven_and_damped_accounts_for_everything():
    scene = jb.RigidScene(EVERYTHING, jb.Ground(slope=0.02), A.PushOff(0.04))
    gait = jb.find_gait(scene, scene.state(**LEANING), parameters=(), accuracy="tight", **HOW)
    names = ("impact_loss", "motor_work")
    told = named_costs_of(scene, gait.measures.state, names, accuracy="tight")
    assert_told(scene, gait, told, 1e-6)


@pytest.mark.nightly
@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("feet", ["rigid", "compliant"])
@pytest.mark.parametrize("name", CASES)
def test_ledgers_close(name, feet, ground):
    """Of walks, and of falls, with nothing but the mechanism's own motors and with more."""
    scene, start = on_feet(name, feet)
    if GROUNDS[ground] is not None:
        scene = jb.with_parameters(scene, {"slope": GROUNDS[ground]})
    driven = dataclasses.replace(scene, actuation=drives_of(name, feet))
    assert_closed(booked(driven, start, 3)[0])
    # On rigid feet knees fall before their second heel strike unless something drives them there.
    if (
        feet == "compliant"
        or ground == "its slope"
        or "shank_1" not in scene.mechanism.structure.bodies
    ):
        assert_closed(booked(scene, start, 3)[0])


@pytest.mark.nightly
@pytest.mark.parametrize("feet", ["rigid", "compliant"])
@pytest.mark.parametrize("name", CASES)
def test_objectives_are_what_is_measured(name, feet):
    scene, start = on_feet(name, feet)
    accuracy, near = ("tight", 1e-7) if feet == "rigid" else ("balanced", 1e-5)
    assert_told(scene, *objectives_of(scene, start, accuracy), near)


@pytest.mark.nightly
@pytest.mark.parametrize("drive", [A.PushOff(0.1), A.HipTorque(0.1), A.FootPreload(3e-3)])
def test_objectives_on_level_ground_are_what_is_measured(drive):
    """Of the seed's walker, without a guess."""
    scene = jb.seed_scene(slope=0.0)
    accuracy, near = ("balanced", 1e-5)
    if drive.feet == "rigid":
        scene, accuracy, near = jb.RigidScene(scene.walker, scene.ground), "tight", 1e-7
    scene = dataclasses.replace(scene, actuation=(drive,))
    assert_told(scene, *objectives_of(scene, None, accuracy), near)

"""Objectives of a gait: gradients against central differences, error bars, energy balance."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from reference.rigid import rigid_walker

import jaxbiped as jb
from jaxbiped.dynamics import RigidState, impact, rolling_field
from tests.optimise.evaluations import evaluated, named_costs_of, of_return_jacobian

pytestmark = pytest.mark.slow
SCENES = jb.ladder() | {"heavy hip": jb.seed_scene(hip_mass=0.5, slope=0.025, r=0.1)}
DRIVEN = {
    "hip torque": dataclasses.replace(
        SCENES["stribeck"], actuation=(jb.actuation.HipTorque(0.05),)
    ),
    "push-off": dataclasses.replace(
        SCENES["rigid"],
        actuation=(jb.actuation.PushOff(0.05), jb.actuation.HipPulse(0.05, phase=0.05)),
    ),
}
"""With motors that brake in a part of the footstep."""
COSTS = ("cost_of_transport", "motor_work", "impact_loss", "foot_clearance")
"""What actuators take part in."""
SCENES |= DRIVEN
VARIED = ("d", "J", "slope")
USUAL = (1e-3, 1e-5)
"""Relative step of the differences, and allowed error of elasticities by the balanced accuracy."""
NOISY = {
    "spectral_radius": (3e-3, 3e-5),
    "radius_bound": (1e-3, 1e-4),
    "floor_sensitivity": (1e-2, 1e-5),
    "clearance_sensitivity": (1e-2, 1e-5),
    "floor_clearance_sensitivity": (1e-2, 1e-5),
    "whole_sensitivity": (1e-2, 1e-5),
    "slip_distance": (1e-2, 1e-5),
    "friction_loss": (1e-3, 1e-5),
}
"""The same for what differences themselves have no better, or the tight accuracy."""

FOLLOWED = ("fold_distance", "doubling_distance")
"""For which branches are followed: see `test_bifurcation_distance`."""
OF_CYCLE = ("motor_work", "impact_loss", "friction_loss", "slip_distance", "foot_clearance")
"""Costs of the motion, beside the objectives."""

PLACES = (-2, -1, 1, 2)


def slope(values):
    """By differences of order four, of values at so many steps."""
    return (8.0 * (values[1] - values[-1]) - (values[2] - values[-2])) / 12.0


def objectives_of(scene):
    known = jb.optimise.OBJECTIVES | {name: jb.optimise.NAMED_COSTS[name] for name in OF_CYCLE}
    for name, measure in known.items():
        if name not in FOLLOWED and measure.lacks(scene) is None:
            yield name


def usual_gait(scene, guess=None, accuracy="balanced"):
    """One kind of search for all tests here, compiled once for each scene."""
    gait = jb.find_gait(scene, guess, radius_sensitivities=False, accuracy=accuracy, engine="lanes")
    assert gait.outcome is jb.gait.Search.FOUND
    return gait


def evaluation(scene, names, guess=None, accuracy="balanced"):
    gait = usual_gait(scene, guess, accuracy)
    return evaluated(scene, gait, names, accuracy), gait.measures.state


@pytest.mark.parametrize(
    "which",
    [
        pytest.param("rigid", marks=pytest.mark.nightly),
        pytest.param("stribeck", marks=pytest.mark.nightly),
        pytest.param("heavy hip", marks=pytest.mark.nightly),
        pytest.param("hip torque", marks=pytest.mark.nightly),
        "push-off",
    ],
)
def test_gradients_are_those_of_central_differences(which):
    """Against fourth-order differences of tightly solved gaits."""
    scene = SCENES[which]
    names, noisy = tuple(objectives_of(scene)), NOISY
    if which in DRIVEN:
        names, noisy = COSTS, dict.fromkeys(COSTS, USUAL)
    told, guess = evaluation(scene, names)
    tight, _ = evaluation(scene, names, guess, "tight")
    for varied in VARIED[:1] if which == "hip torque" else VARIED:
        own = float(jb.parameter_values(scene)[varied])
        place = jb.parameter_names(scene).index(varied)
        for step in sorted({USUAL[0], *(each[0] for each in noisy.values())}):
            kind = tuple(name for name in names if noisy.get(name, USUAL)[0] == step)
            if not kind:
                continue
            at = {
                k: evaluation(
                    jb.with_parameters(scene, {varied: own * (1.0 + k * step)}),
                    kind,
                    guess,
                    "tight",
                )[0].values
                for k in PLACES
            }
            for name in kind:
                size = abs(tight.values[name])
                true = slope({k: values[name] for k, values in at.items()}) / step / size
                off = {
                    each: abs(known.slopes[name][place] * own / size - true)
                    for each, known in (("balanced", told), ("tight", tight))
                }
                apart = abs(told.slopes[name][place] - tight.slopes[name][place]) * own / size
                assert apart <= USUAL[1] * max(1.0, abs(true)), (name, varied)
                if name not in noisy:
                    # Of steep ones the error is relative.
                    assert off["balanced"] <= USUAL[1] * max(1.0, abs(true)), (name, varied)
                    continue
                bar = told.slope_errors[name][place] * own / size
                assert off["tight"] <= noisy[name][1], (name, varied)
                assert off["balanced"] <= noisy[name][1] + 5.0 * bar, (name, varied)


@pytest.mark.parametrize("which", ["rigid", pytest.param("stribeck", marks=pytest.mark.nightly)])
def test_energy_that_gravity_gives_is_lost(which):
    """Weight times the descent equals the losses, to their error bars."""
    scene = SCENES[which]
    losses = {"impact_loss", "friction_loss"} & set(objectives_of(scene))
    known, _ = evaluation(scene, ("step_length", "cost_of_transport", *sorted(losses)))
    weight = float(scene.walker.total_mass * scene.ground.g)
    work = weight * known.values["step_length"] * np.sin(float(scene.ground.slope))
    lost = sum(known.values[name] for name in losses)
    assert lost == pytest.approx(work, rel=1e-6)
    sine = np.sin(float(scene.ground.slope))
    assert known.values["cost_of_transport"] == pytest.approx(sine, rel=1e-6)
    # So the gradient of a passive cost of transport is the slope's alone.
    names = jb.parameter_names(scene)
    expected = np.zeros(len(names))
    expected[names.index("slope")] = np.cos(float(scene.ground.slope))
    values = np.asarray([float(v) for v in jb.parameter_values(scene).values()])
    off = (known.slopes["cost_of_transport"] - expected) * values / sine
    assert np.max(np.abs(off)) < 1e-4


@pytest.mark.parametrize("which", DRIVEN)
def test_costs_of_driven_walkers_are_those_of_the_ledger(which):
    """Quadrature of the powers along a walk, whose motors do not drive all the time."""
    scene = SCENES[which]
    names = {"cost_of_transport", "motor_work", "impact_loss", "friction_loss"}
    names = tuple(name for name in objectives_of(scene) if name in names)
    known, state = evaluation(scene, names, accuracy="tight")
    if isinstance(scene, jb.RigidScene):
        walk = jb.rigid_walk(scene, state, footsteps=2, max_arrivals=2, accuracy="tight")
        books = jb.measure.rigid_ledger(scene, walk)
        loss, work = books.impact_loss[0], books.actuation_work[0]
    else:
        walk = jb.simulate(scene, state, footsteps=3, accuracy="tight", engine="lanes")
        ends = jb.measure.heel_strikes(scene, walk).time_s
        books = jb.measure.energy_ledger(scene, walk, ends)
        loss, work = books.damper_loss[-1], books.actuation_work[-1]
        assert known.values["friction_loss"] == pytest.approx(books.friction_loss[-1], rel=1e-4)
    cost = jb.measure.cost_of_transport(scene, walk)
    assert cost.motor_work[-1] > work + 1e-6
    assert known.values["motor_work"] == pytest.approx(cost.motor_work[-1], rel=1e-6)
    assert known.values["cost_of_transport"] == pytest.approx(cost.cost[-1], rel=1e-6)
    assert known.values["impact_loss"] == pytest.approx(loss, rel=1e-5)


def test_the_rigid_clearance_is_that_of_the_rigid_checks():
    scene = SCENES["rigid"]
    gait = usual_gait(scene)
    named = named_costs_of(scene, gait.measures.state, ("foot_clearance",))
    clearance = named["foot_clearance"]
    lowest = float(jb.dynamics.rigid_checks(scene, gait.orbit[1]).clearance.min())
    assert clearance <= lowest
    assert clearance == pytest.approx(lowest, rel=0.2)


@pytest.mark.parametrize("which", ["rigid", pytest.param("stribeck", marks=pytest.mark.nightly)])
def test_the_bound_is_above_the_radius_and_the_moduli_are_the_multipliers(which):
    scene = SCENES[which]
    gait = usual_gait(scene)
    names = ("spectral_radius", "modulus_2", "radius_bound")
    found = of_return_jacobian(scene, gait.measures.state, names)
    values = dict(zip(names, np.asarray(found.values), strict=True))
    upper = np.asarray(gait.multipliers)
    upper = np.sort(np.abs(upper[upper.imag >= 0.0]))[::-1]
    assert values["spectral_radius"] == pytest.approx(upper[0], rel=1e-4)
    assert values["modulus_2"] == pytest.approx(upper[1], rel=1e-3)
    assert upper[0] < values["radius_bound"] < 1.1 * upper[0]


def test_a_push_over_a_cycle_of_two_has_the_gradient_of_differences():
    """It ends with the second impact, which no shift in time carries on."""
    scene, names = SCENES["rigid"], ("sensitivity_norm",)
    own, step = float(scene.walker.d), 1e-3

    def told(d):
        there = jb.with_parameters(scene, {"d": d})
        state = usual_gait(there).measures.state
        return of_return_jacobian(there, state, names, arrivals=2)

    place = jb.parameter_names(scene).index("d")
    norms = {k: float(told(own * (1.0 + k * step)).values[0]) for k in PLACES}
    assert float(told(own).slopes[0, place]) == pytest.approx(slope(norms) / step / own, rel=1e-6)


def test_the_divergence_of_the_foot_strike_is_that_of_its_saltation_matrix():
    """The determinant of one impact, in angles and momenta."""
    scene = SCENES["rigid"]
    gait = jb.find_gait(scene, accuracy="tight", parameters=(), radius_sensitivities=False)
    before = rigid_walker(scene).until_strike(gait.measures.state[1:]).y_events[0][0]

    def struck(y):
        return jnp.stack(impact(scene, RigidState(jnp.zeros(()), *y)).state[1:])

    def rates(y):
        return jnp.stack(rolling_field(0.0, RigidState(jnp.zeros(()), *y), scene)[1:])

    def volume(y):
        """Of momenta for each of rates: the determinant of the mass matrix."""

        def kinetic(rates):
            state = RigidState(jnp.zeros(()), *y[:2], *rates)
            return jb.dynamics.energies(scene, state).kinetic

        return jnp.linalg.det(jax.hessian(kinetic)(y[2:]))

    after, by_state = struck(before), jax.jacfwd(struck)(before)
    coming, leaving = rates(before), rates(after)
    normal = jnp.asarray([1.0, 1.0, 0.0, 0.0])
    saltation = by_state + jnp.outer(leaving - by_state @ coming, normal) / (normal @ coming)
    change = jnp.linalg.det(saltation) * volume(after) / volume(before)
    names = ("strike_divergence",)
    told = of_return_jacobian(scene, gait.measures.state, names, accuracy="tight")
    assert float(told.values[0]) == pytest.approx(float(jnp.log(jnp.abs(change))), rel=1e-7)
    assert float(told.values[0]) < 0.0


@pytest.mark.parametrize(
    ("which", "names"),
    [
        ("rigid", ("spectral_radius", "radius_bound", "impact_loss", "foot_clearance")),
        pytest.param("stribeck", (), id="stribeck", marks=pytest.mark.nightly),
    ],
)
def test_error_bars_of_values_hold_against_a_tight_solve(which, names):
    """Of those named, or of all."""
    scene = SCENES[which]
    names = names or tuple(objectives_of(scene))
    known, guess = evaluation(scene, names)
    tight, _ = evaluation(scene, names, guess, "tight")
    for name in names:
        off = abs(known.values[name] - tight.values[name])
        assert off <= 10.0 * known.errors[name] + 1e-9 * abs(tight.values[name]), name


@pytest.mark.parametrize(
    ("name", "which", "changes", "sentence"),
    [
        ("slip_distance", "rigid", {}, r"slip_distance.*roll without slip"),
        ("friction_loss", "stribeck", {"friction": jb.laws.Frictionless()}, "is Frictionless"),
        ("foot_clearance", "stribeck", {"clearance": jb.laws.AlwaysTouching()}, "AlwaysTouching"),
        ("motor_work", "rigid", {}, r"motor_work.*no motors"),
        ("strike_divergence", "stribeck", {}, r"strike_divergence.*striking at once"),
        ("strike_divergence", "push-off", {}, r"strike_divergence.*drives"),
        ("fatal_push", "stribeck", {}, r"fatal_push.*minimal_fatal_shock"),
        ("beauty", "stribeck", {}, "minimise = 'beauty'"),
    ],
)
def test_an_objective_that_a_scene_lacks_is_refused_in_a_sentence(name, which, changes, sentence):
    scene = dataclasses.replace(SCENES[which], **changes)
    with pytest.raises(jb.ArgumentError, match=sentence):
        jb.optimise_gait(scene, vary={"d": (0.08, 0.12)}, minimise=name)

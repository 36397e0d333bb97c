"""Costs of transport and of actuators, against ledgers that close; operations, against less."""

import dataclasses
import re
from collections import Counter

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.rigid_walkers import rigid_seed

A = jb.actuation
SEED = jb.seed_scene(hip_mass=0.1)
START = jb.seed_state()
PARTS = (
    A.HipSpring(k=0.05, b=0.001, theta_0=0.1),
    A.HipSpline([0.01, 0.03, -0.02]),
    A.HipPulse(-0.02, reaction="trunk"),
)
PASSIVE_LEDGER = ("gravity_work", "damper_loss", "friction_loss", "stored_change", "residual")


@pytest.fixture(scope="module")
def driven():
    """A compliant walk with everything that may drive it: scene and trajectory."""
    scene = dataclasses.replace(SEED, actuation=(*PARTS, A.FootPreload(extension=5e-4)))
    return scene, jb.simulate(scene, START, footsteps=3, accuracy="tight", engine="lanes")


@pytest.fixture(scope="module")
def rolled():
    """The same of the rigid walker."""
    scene = jb.RigidScene(SEED.walker, SEED.ground, (*PARTS, A.PushOff(0.05)))
    start = jb.dynamics.rigid_state(START)
    return scene, jb.rigid_walk(scene, start, footsteps=4, max_arrivals=4, accuracy="tight")


def test_the_ledger_closes_with_actuators(driven):
    scene, walk = driven
    books = jb.measure.energy_ledger(scene, walk)
    assert abs(books.residual[0]) < 5e-9
    assert books.actuation_work[0] > 1e3 * abs(books.residual[0])
    lost = books.damper_loss + books.friction_loss
    gained = books.gravity_work + books.actuation_work
    np.testing.assert_allclose(gained, lost + books.stored_change + books.residual, rtol=1e-14)


def test_the_column_of_a_passive_walk_is_zero():
    walk = jb.simulate(SEED, START, footsteps=2, accuracy="draft", engine="lanes")
    books = jb.measure.energy_ledger(SEED, walk)
    assert books._fields == (*PASSIVE_LEDGER, "actuation_work")
    assert books.actuation_work.tolist() == [0.0]
    powers = jb.dynamics.powers(SEED, START)
    assert powers.actuation is None
    assert powers.motors is None


def test_works_are_sums_over_actuators(driven):
    """Of each alone, along the same motion; the preload's by its definition F_N de/dt."""
    scene, walk = driven
    together = jb.dynamics.powers(scene, walk.state)
    hip_only = dataclasses.replace(scene, actuation=PARTS)
    torque = 0.0
    for part in PARTS:
        alone = dataclasses.replace(scene, actuation=(part, scene.actuation[-1]))
        torque = torque + jb.dynamics.powers(alone, walk.state).actuation
    feet_only = dataclasses.replace(scene, actuation=scene.actuation[-1:])
    feet = jb.dynamics.powers(feet_only, walk.state)
    expected = torque - (len(PARTS) - 1) * feet.actuation
    np.testing.assert_allclose(together.actuation, expected, atol=1e-10)
    forces = jb.dynamics.foot_forces(scene, walk.state)
    _, speed = scene.actuation[-1].set_point(walk.state.theta_2, walk.state.omega_2)
    # Two programs, each of which rounds the difference that is the foot's depth.
    np.testing.assert_allclose(together.motors[-1], forces[1].normal * speed, rtol=1e-9, atol=1e-14)
    assert len(together.motors) == len(PARTS) + 2
    assert len(jb.dynamics.powers(hip_only, walk.state).motors) == len(PARTS)


def test_the_rigid_ledger_closes(rolled):
    scene, walk = rolled
    books = jb.measure.rigid_ledger(scene, walk)
    assert books.residual.shape == (3,)
    assert np.abs(books.residual).max() < 1e-10
    assert (books.actuation_work > 0.01).all()
    assert (books.impact_loss > 0.0).all()


@pytest.mark.slow
def test_a_passive_gait_costs_the_slopes_sine():
    for slope in (0.01, 0.03):
        scene = rigid_seed(slope)
        gait = jb.find_gait(scene, accuracy="tight", parameters=(), engine="lanes")
        walk = jb.rigid_walk(
            scene, gait.measures.state, footsteps=3, max_arrivals=3, accuracy="tight"
        )
        found = jb.measure.cost_of_transport(scene, walk)
        np.testing.assert_allclose(found.cost, np.sin(slope), rtol=1e-8)
        assert found.motor_work.tolist() == [0.0, 0.0]
        books = jb.measure.rigid_ledger(scene, walk)
        np.testing.assert_allclose(books.impact_loss, books.gravity_work, rtol=1e-7)


def test_costs_count_motors_where_they_drive(driven, rolled):
    scene, walk = driven
    found = jb.measure.cost_of_transport(scene, walk)
    strikes = jb.measure.heel_strikes(scene, walk).time_s
    books = jb.measure.energy_ledger(scene, walk, strikes)
    np.testing.assert_allclose(found.gravity_work, books.gravity_work, rtol=1e-12)
    weight = float(scene.walker.total_mass * scene.ground.g)
    np.testing.assert_allclose(
        found.cost, (found.motor_work + books.gravity_work) / (weight * found.distance)
    )
    np.testing.assert_array_equal(jb.footsteps(scene, walk).cost_of_transport, found.cost)
    # The pulse brakes, the spring's damper loses: what motors do is more than all work.
    assert (found.motor_work > books.actuation_work).all()
    between = jb.measure.cost_of_transport(scene, walk, times=strikes[[0, -1]])
    assert between.motor_work[0] == pytest.approx(found.motor_work.sum(), rel=1e-6)
    scene, walk = rolled
    costs = jb.measure.cost_of_transport(scene, walk)
    assert (costs.motor_work > jb.measure.rigid_ledger(scene, walk).actuation_work).all()


def _simplest(impulse):
    walker = jb.Walker(m=1e-13, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1.0)
    return jb.RigidScene(walker, jb.Ground(slope=0.0, g=1.0), A.PushOff(impulse))


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.1, 0.2])
def test_the_simplest_walker_pushes_off_with_tan_of_its_angle(angle):
    """Kuo 2002: on level ground P = v tan α, and its work is ½ P²."""
    impulse = 1.046 * angle * np.tan(angle)
    scene = _simplest(impulse)
    rate = -1.046 * angle
    guess = jb.dynamics.RigidState(
        *map(jnp.asarray, (0.0, -angle, angle, rate * np.cos(2.0 * angle), rate))
    )
    gait = jb.find_gait(scene, guess, accuracy="tight", parameters=(), engine="lanes")
    assert str(gait.outcome) == "found"
    state = gait.measures.state
    alpha, speed = float(state.theta_2), -float(state.omega_2)
    assert alpha == pytest.approx(angle, rel=0.01)
    assert impulse == pytest.approx(speed * np.tan(alpha), rel=1e-9)
    walk = jb.rigid_walk(scene, state, footsteps=3, max_arrivals=3, accuracy="tight")
    books = jb.measure.rigid_ledger(scene, walk)
    np.testing.assert_allclose(books.actuation_work, 0.5 * impulse**2, rtol=1e-9)
    found = jb.measure.cost_of_transport(scene, walk)
    expected = (speed * np.tan(alpha)) ** 2 / (4.0 * np.sin(alpha))
    np.testing.assert_allclose(found.cost, expected, rtol=1e-7)


def test_refusals():
    scene = rigid_seed()
    start = jb.dynamics.rigid_state(START)
    few = jb.rigid_walk(scene, start, footsteps=1, max_arrivals=1, engine="lanes")
    with pytest.raises(jb.ArgumentError, match="fewer than two heel strikes"):
        jb.measure.cost_of_transport(scene, few)
    with pytest.raises(jb.ArgumentError, match="times is not allowed"):
        jb.measure.cost_of_transport(scene, few, times=np.array([0.0, 1.0]))
    with pytest.raises(jb.ArgumentError, match=r"walk\.state"):
        jb.measure.cost_of_transport(SEED, few)
    with pytest.raises(jb.ArgumentError, match="RigidScene"):
        jb.measure.rigid_ledger(SEED, few)


PLAIN = jb.seed_scene()
BRISTLES = jb.laws.LuGre(mu_static=0.5, mu_kinetic=0.4, v_s=1e-3, sigma_0=5e4, sigma_1=100.0)


def scene(**parts):
    return dataclasses.replace(PLAIN, **parts)


def compiled(scene):
    """Operations of the vector field as XLA compiles it: those within its fusions."""
    field = jax.jit(lambda y, args: jb.dynamics.vector_field(0.0, y, args))
    text = field.lower(jb.seed_state(), scene).compile().as_text()
    return Counter(re.findall(r"= \S+ (\w+[-\w]*)\(", text))


def test_an_exponential_only_with_stribeck_or_a_power():
    linear = jb.laws.KelvinVoigt(K=3e4, D=5e3)
    peaked, flat, none, viscous, coulomb = (
        compiled(scene(normal=linear, friction=law))
        for law in (
            PLAIN.friction,
            jb.laws.Threlfall(mu=0.4, v0=1e-4),
            jb.laws.Frictionless(),
            jb.laws.Viscous(k=100.0),
            jb.laws.RegularisedCoulomb(mu=0.4, v_d=1e-4),
        )
    )
    assert peaked["exponential"] >= 2
    assert flat["exponential"] >= 2
    assert none["exponential"] == viscous["exponential"] == 0
    assert coulomb["tanh"] >= 2
    assert none["tanh"] == peaked["tanh"] == 0
    assert none["sign"] == 0


def test_one_foots_contact_where_only_one_can_touch():
    both = compiled(scene(clearance=jb.laws.AlwaysTouching()))
    one = compiled(scene(clearance=jb.laws.OneFoot(leg=2)))
    assert 0 < one["exponential"] <= both["exponential"] // 2
    one, both = (
        jb.measure.operation_counts(scene(clearance=rule))["libm log"]
        for rule in (jb.laws.OneFoot(leg=2), jb.laws.AlwaysTouching())
    )
    assert 0 < 2 * one == both


def test_operations_fall_as_scenes_use_less():
    def total(scene):
        return sum(jb.measure.operation_counts(scene).values())

    frictionless = scene(friction=jb.laws.Frictionless())
    assert total(jb.RigidScene(PLAIN.walker, PLAIN.ground)) < total(frictionless)
    assert total(frictionless) < total(scene(friction=jb.laws.Viscous(k=100.0))) < total(PLAIN)
    assert total(scene(clearance=jb.laws.AlwaysTouching())) < total(PLAIN)
    assert total(scene(clearance=jb.laws.OneFoot(leg=2))) < 0.75 * total(PLAIN)
    assert total(PLAIN) < total(scene(friction=BRISTLES))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["lanes", pytest.param("xla", marks=pytest.mark.nightly)])
def test_a_foot_that_never_touches_falls_through_the_ground(engine):
    only_leg_1 = scene(clearance=jb.laws.OneFoot(leg=1))
    forces = jb.dynamics.foot_forces(only_leg_1, jb.seed_state())
    assert float(forces[1].normal) == float(forces[1].tangential) == 0.0
    assert float(jb.dynamics.foot_forces(PLAIN, jb.seed_state())[1].normal) > 0.0
    fall = jb.simulate(
        only_leg_1, jb.seed_state(), duration=1.0, save="end", engine=engine, watch=("fall",)
    )
    assert fall.outcome in (jb.Ending.FELL_FORWARD, jb.Ending.FELL_BACK)
    with pytest.raises(jb.ArgumentError, match="leg = 3"):
        jb.laws.OneFoot(leg=3)

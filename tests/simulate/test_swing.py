"""Linkages in gravity, against pendulums and SciPy: every method, redundant joints."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxbiped as jb
from tests.linkages import (
    four_bar,
    four_bar_state,
    hanging,
    one_leg,
    pinned_pendulum,
    with_euler_parameters,
)

pytestmark = pytest.mark.slow

TIMES = jnp.linspace(0.0, 2.0, 201)
START = hanging(0.5, -0.8, rates=(1.0, 2.0))
ONE_LEG_START = hanging(0.5, rates=(1.0,))
PROJECTING = ("index1", "index1aug", "described")


@pytest.fixture(scope="module")
def angles():
    """The pendulum's angles after 2 s by SciPy: two legs that do not feel each other at one pin."""
    inertia = 0.0096 + 0.1**2

    def rates(t, y):
        return [y[2], y[3], *(-9.8 * 0.1 / inertia * np.sin(y[:2]))]

    return solve_ivp(rates, (0.0, 2.0), [0.5, -0.8, 1.0, 2.0], rtol=1e-11, atol=1e-12).y[:2, -1]


@pytest.fixture(scope="module")
def swings():
    """One leg of the pendulum by every method in explicit Euler steps of 1e-4 s."""
    how = dict(times=TIMES, solver="euler", dt=1e-4)
    return {
        name: jb.swing(jb.dynamics.LinkageScene(one_leg(), kind()), ONE_LEG_START, **how)
        for name, kind in jb.constraints.CONSTRAINT_METHODS.items()
    }


def test_the_pendulum_by_seven_methods(swings, angles):
    worst = {name: float(jnp.max(each.violation)) for name, each in swings.items()}
    for name, each in swings.items():
        assert each.outcome is jb.Ending.FINISHED
        assert (int(each.accepted), int(each.rejected)) == (20000, 0)
        assert abs(float(each.state.q[2][-1]) - angles[0]) < 0.02, name
    for name in PROJECTING:
        assert worst[name] < 1e-14
    for name in ("baumgarte", "penalty", "augmented"):
        assert 1e-8 < worst[name] < 0.5 * worst["standard"]


@pytest.mark.parametrize(
    ("how", "ending"),
    [
        (dict(max_solver_steps=20), jb.Ending.OUT_OF_STEPS),
        (dict(solver="euler", dt=0.1), jb.Ending.SOLVER_FAILED),
    ],
)
def test_a_swing_that_does_not_finish_says_why(how, ending):
    """Explicit steps far too long for constraints that are pulled back at 1e20 1/s run away."""
    scene = jb.dynamics.LinkageScene(one_leg(), jb.constraints.Baumgarte(a=1e20, b=1e20))
    found = jb.swing(scene, ONE_LEG_START, times=TIMES, **how)
    assert found.outcome is ending
    assert repr(found).startswith(f"Trajectory({ending}, engine=lanes, shape=(201,), dtype=float64")


def test_projected_steps_agree_with_scipy(angles):
    scene = jb.dynamics.LinkageScene(pinned_pendulum("euler"), jb.constraints.Index1())
    found = jb.swing(scene, with_euler_parameters(START), times=TIMES, solver="dopri5", rtol=1e-8)
    for k, expected in enumerate(angles):
        cosine, sine = (found.state.q[4 * k + i][-1] for i in (2, 3))
        assert float(2.0 * jnp.arctan2(sine, cosine)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.nightly
@pytest.mark.parametrize("how", [dict(rtol=1e-9), dict(solver="runge2", dt=1e-3)])
def test_lanes_swing_as_diffrax_does(how):
    """By the same steps to rounding, by others to the tolerance."""
    scene = jb.dynamics.LinkageScene(one_leg(), jb.constraints.Index1())
    lanes, xla = (
        jb.swing(scene, ONE_LEG_START, times=TIMES, adjoint=adjoint, **how)
        for adjoint in (None, diffrax.RecursiveCheckpointAdjoint())
    )
    assert (lanes.engine, xla.engine) == ("lanes", "xla")
    bound = 1e-12 if "dt" in how else 1e-7
    for a, b in zip(jax.tree.leaves(lanes.state), jax.tree.leaves(xla.state), strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=bound)
    np.testing.assert_array_equal(lanes.t, xla.t)


def test_a_four_bar_keeps_its_energy_and_its_joints():
    linkage = four_bar()
    scene = jb.dynamics.LinkageScene(linkage, jb.constraints.DirectCorrection())
    found = jb.swing(scene, four_bar_state(1.1, 3.0), times=TIMES, solver="dopri5", rtol=1e-9)
    assert float(jnp.max(found.violation[-1])) < 1e-14
    energy = jnp.zeros_like(found.t)
    for k, body in enumerate(linkage.bodies):
        (_, z, _), (vx, vz, rate) = (part[3 * k : 3 * k + 3] for part in found.state)
        energy = energy + 0.5 * (body.mass * (vx**2 + vz**2) + body.inertia * rate**2)
        energy = energy + 9.8 * body.mass * z
    assert float(jnp.ptp(energy)) < 1e-5 * float(jnp.max(jnp.abs(energy)))
    assert float(jnp.ptp(found.state.q[2])) > 1.0


@pytest.mark.parametrize("name", jb.constraints.CONSTRAINT_METHODS)
def test_a_joint_said_twice(name, angles):
    """Singular: methods with a penalty share the load between the two, the others say so."""
    method = jb.constraints.CONSTRAINT_METHODS[name]()
    scene = jb.dynamics.LinkageScene(pinned_pendulum(twice=True), method)
    how = dict(times=TIMES[:11], solver="euler", dt=1e-3)
    if method.needs_independent:
        with pytest.raises(
            jb.ArgumentError, match="2 of 6 constraints are redundant, because they follow"
        ):
            jb.swing(scene, START, **how)
        return
    plain = jb.dynamics.LinkageScene(pinned_pendulum(), method)
    start = jax.tree.map(jnp.asarray, START)
    once, twice = (jb.dynamics.linkage_motion(each, start) for each in (plain, scene))
    np.testing.assert_allclose(
        np.array(twice.accelerations), np.array(once.accelerations), rtol=1e-5, atol=1e-5
    )
    shared = np.array(twice.joint_forces)
    # Equal shares but for A s roundings.
    np.testing.assert_allclose(shared[1], shared[2], rtol=1e-5)
    np.testing.assert_allclose(shared[1] + shared[2], np.array(once.joint_forces)[1], rtol=1e-5)


def end_of(distance, adjoint):
    """A leg's angle after projected Runge–Kutta steps, by where the pin is in it."""
    scene = jb.dynamics.LinkageScene(one_leg(distance), jb.constraints.Index1())
    # The start has to be put on the constraints of the length.
    how = dict(times=TIMES[:51:50], solver="runge2", dt=1e-2, max_solver_steps=64)
    return jb.swing(scene, ONE_LEG_START, adjoint=adjoint, **how).state.q[2][-1]


def test_projected_solves_differentiate_and_batch():
    """By the adjoint for forward mode in a batch, and by the one that knows both modes."""
    lengths, one = jnp.asarray([0.101 - 1e-6, 0.101, 0.101 + 1e-6]), jnp.asarray(1.0)

    def forward(length):
        return jax.jvp(lambda d: end_of(d, diffrax.ForwardMode()), (length,), (one,))

    values, slopes = jax.vmap(forward)(lengths)
    assert float(slopes[1]) == pytest.approx(float(values[2] - values[0]) / 2e-6, rel=1e-6)
    assert abs(float(slopes[1])) > 0.1
    slope = jax.grad(lambda d: end_of(d, diffrax.DirectAdjoint()))(lengths[1])
    assert float(slope) == pytest.approx(float(slopes[1]), rel=1e-11)


@pytest.mark.parametrize("kind", [diffrax.BacksolveAdjoint, diffrax.ImplicitAdjoint])
def test_adjoints_that_see_no_projection_are_refused(kind):
    said = f"adjoint = {kind.__name__} is not allowed for method = Index1, which projects"
    with pytest.raises(jb.ArgumentError, match=said):
        end_of(0.101, kind())
    held = jb.RedundantScene(jb.seed_scene(), "index1")
    with pytest.raises(jb.ArgumentError, match=said):
        jb.simulate(held, jb.seed_state(), duration=0.1, adjoint=kind())


STILL = hanging(0.5, rates=(0.0,))


def one_leg_angle(time):
    """By SciPy, from rest at 0.5 rad."""
    pull = -9.8 * 0.1 / (0.0096 + 0.1**2)
    field = lambda t, y: [y[1], pull * np.sin(y[0])]
    return solve_ivp(field, (0.0, time), [0.5, 0.0], rtol=1e-11, atol=1e-12).y[0, -1]


@pytest.mark.parametrize(
    ("solver", "dt", "long"),
    [("euler", 0.02, True), ("euler", 1e-3, True), ("rodas4", 0.2, True), ("rodas4", 0.02, False)],
)
def test_steps_of_one_size_that_are_too_long_are_told(solver, dt, long, recwarn):
    scene = jb.dynamics.LinkageScene(one_leg(), jb.constraints.Index1())
    found = jb.swing(scene, STILL, times=[0.0, 3.0], solver=solver, dt=dt)
    told = any(f"dt = {dt:g} is too long" in str(each.message) for each in recwarn)
    assert told is long
    if not long:
        assert float(found.state.q[2][-1]) == pytest.approx(one_leg_angle(3.0), abs=5e-3)


def test_an_implicit_method_of_diffrax_keeps_projected_constraints():
    scene = jb.dynamics.LinkageScene(one_leg(), jb.constraints.Index1())
    found = jb.swing(scene, STILL, times=[3.0], solver="kvaerno5", accuracy="tight")
    assert float(found.state.q[2][-1]) == pytest.approx(one_leg_angle(3.0), abs=1e-7)
    assert float(found.violation[-1]) < 1e-12


def test_an_implicit_solver_takes_steps_of_one_size_also_by_simulate():
    scene = jb.dynamics.LinkageScene(one_leg(), jb.constraints.Index1())
    how = dict(solver="kvaerno5", dt=0.01)
    found = jb.swing(scene, STILL, times=[3.0], **how)
    assert float(found.state.q[2][-1]) == pytest.approx(one_leg_angle(3.0), abs=1e-4)
    same = jb.simulate(scene, STILL, save=[3.0], **how)
    assert jax.tree.all(jax.tree.map(np.array_equal, found, same))


LEG = jb.dynamics.LinkageScene(one_leg(), jb.constraints.Index1())
PULL = -9.8 * 0.1 / (0.0096 + 0.1**2)


@pytest.fixture(scope="module")
def pendulum():
    """One leg's angle, its rate and their derivatives by the first rate, with dense output."""

    def rates(t, y):
        return [y[1], PULL * np.sin(y[0]), y[3], PULL * np.cos(y[0]) * y[2]]

    def vertical(t, y):
        return y[0]

    vertical.direction = -1
    start = [0.5, 1.0, 0.0, 1.0]
    return solve_ivp(
        rates, (0.0, 2.0), start, rtol=1e-11, atol=1e-12, dense_output=True, events=vertical
    )


def swung(rate=1.0, **how):
    return jb.simulate(LEG, hanging(0.5, rates=(rate,)), **{"duration": 2.0, **how})


def test_every_step_of_a_linkage_is_kept_with_what_lies_between(pendulum):
    walk, times = swung(), np.linspace(0.03, 1.97, 11)
    assert walk.outcome is jb.Ending.FINISHED
    assert (walk.engine, float(walk.t[-1])) == ("lanes", 2.0)
    assert len(walk.t) == 1 + int(walk.accepted)
    assert float(jnp.max(walk.violation)) < 1e-14
    np.testing.assert_allclose(walk.at(times).q[2], pendulum.sol(times)[0], rtol=0, atol=1e-5)
    ends = np.asarray(walk.t)
    np.testing.assert_allclose(walk.state.v[2], pendulum.sol(ends)[1], rtol=0, atol=1e-5)


def test_a_linkage_arrives_at_sections_and_tells_its_extremes(pendulum):
    hangs = jb.Section(lambda scene, state: -state.q[2])
    walk = swung(save=hangs, extremes=lambda scene, state: state.q[2])
    (times,) = pendulum.t_events
    assert int(walk.arrivals.total) == len(times) == 2
    np.testing.assert_allclose(walk.arrivals.t[:2], times, rtol=0, atol=1e-6)
    rates = pendulum.y_events[0][:, 1]
    np.testing.assert_allclose(walk.arrivals.state.v[2][:2], rates, rtol=0, atol=1e-5)
    highest = np.max(pendulum.sol(np.linspace(0.0, 2.0, 2001))[0])
    assert float(walk.highest) == pytest.approx(highest, abs=5e-3)  # at the ends of steps
    xla = swung(save=hangs, engine="xla")
    np.testing.assert_allclose(xla.arrivals.t[:2], times, rtol=0, atol=1e-6)


def test_a_linkage_has_derivatives_of_its_end_its_times_and_its_arrivals(pendulum):
    hangs, times = jb.Section(lambda scene, state: -state.q[2]), np.array([0.5, 2.0])

    def told(rate):
        at_times = swung(rate, save=times).state.q[2]
        return *at_times, *swung(rate, save=hangs).arrivals.t[:2]

    *slopes, first, second = map(float, jax.jacfwd(told)(1.0))
    np.testing.assert_allclose(slopes, pendulum.sol(times)[2], rtol=1e-4)
    for slope, (_, rate, by_rate, _) in zip((first, second), pendulum.y_events[0], strict=True):
        assert slope == pytest.approx(-by_rate / rate, rel=1e-4)
    backwards = jax.grad(lambda rate: swung(rate, save="end").state.q[2][-1])(1.0)
    assert float(backwards) == pytest.approx(float(pendulum.sol(2.0)[2]), rel=1e-4)


def test_the_bars_of_a_linkage_hold(pendulum):
    walk = swung(save="end", accuracy=1e-7)
    off = abs(float(walk.final.q[2]) - pendulum.sol(2.0)[0])
    assert walk.error.met
    assert off <= float(walk.error.bars["state"].q[2][-1]) < 1e-6


def test_a_batch_and_a_jitted_linkage_swing_like_one_by_itself():
    rates = jnp.array([0.5, 1.0])
    end = lambda rate: swung(rate, save="end").final.q[2]
    alone = [float(end(rate)) for rate in rates]
    np.testing.assert_allclose(jax.vmap(end)(rates), alone, rtol=0, atol=1e-13)
    assert float(jax.jit(end)(1.0)) == pytest.approx(alone[1], abs=1e-13)


def test_the_last_time_to_save_at_ends_a_simulation_of_any_scene():
    times = np.array([0.1, 0.2])
    for scene, state in ((LEG, ONE_LEG_START), (jb.seed_scene(), jb.seed_state())):
        walk = jb.simulate(scene, state, save=times)
        np.testing.assert_array_equal(walk.t, times)
        longer = jb.simulate(scene, state, save=times, duration=0.2)
        assert jax.tree.all(jax.tree.map(np.array_equal, walk.state, longer.state))

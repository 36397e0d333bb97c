"""Simulations against an independent integrator, closed forms, and each other."""

import functools

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import ACCURACIES
from tests.compliant_walkers import frictionless_walker

pytestmark = pytest.mark.slow


def _walk(**how):
    return jb.simulate(jb.seed_scene(), jb.seed_state(), **{"save": "end"} | how)


def _error(trajectory, state):
    return np.abs(np.array(trajectory.final) - state).max()


def test_tight_state_error_is_below_1e_6(seed_walk, reference):
    times, states = reference
    _, walk = seed_walk
    assert walk.outcome == jb.Ending.WALKING
    assert _error(walk, states[-1]) < 1e-6
    between = np.array(walk.at(times)).T
    assert np.abs(between - states).max() < 1e-5


@pytest.mark.parametrize("solver", ["rodas4", "rodas4p", "rodas5p"])
def test_balanced_state_errors(solver, reference):
    assert _error(_walk(duration=2.0, solver=solver), reference[1][-1]) < 2e-4


def test_the_reference_itself(reference):
    """Two programs, two integrators, one answer: at their tightest they agree to 1e-8."""
    walk = _walk(duration=2.0, solver="rodas5p", rtol=1e-11, atol=1e-13)
    assert _error(walk, reference[1][-1]) < 1e-8


def test_error_falls_with_the_tolerance_where_the_field_is_smooth(reference):
    """In single support, t ≤ 0.35 s: a hundredth of the tolerance, a hundredth of the error."""
    times, states = reference
    at = int(np.searchsorted(times, 0.35))
    errors = []
    for rtol in (1e-4, 1e-6, 1e-8):
        errors.append(_error(_walk(duration=times[at], rtol=rtol), states[at]))
    slope = np.polyfit([-4, -6, -8], np.log10(errors), 1)[0]
    assert slope > 0.7
    assert errors[-1] < 1e-7


@pytest.mark.nightly
def test_other_solvers_stay_available(reference):
    """diffrax's implicit ones solve the walk; its explicit ones are there for soft scenes."""
    walk = _walk(duration=0.35, solver="kvaerno5")
    at = int(np.searchsorted(reference[0], 0.35))
    assert _error(walk, reference[1][at]) < 1e-4
    high = jb.seed_state()._replace(hip_z=jnp.asarray(5.0))
    flights = [
        jb.simulate(jb.seed_scene(), high, duration=0.3, solver=name, accuracy="tight", save="end")
        for name in ("tsit5", "rodas4")
    ]
    np.testing.assert_allclose(np.array(flights[0].final), np.array(flights[1].final), atol=1e-6)


def test_energy_is_kept_without_damper_and_friction():
    """The seed's walker bouncing on Hertz feet, frictionless."""
    scene = frictionless_walker(K=1e5)
    start = jb.seed_state()._replace(hip_z=jnp.asarray(0.45))
    motion = jb.simulate(scene, start, duration=0.6, accuracy="tight", watch=())
    assert float(jnp.max(jb.dynamics.foot_forces(scene, motion.state)[1].normal)) > 50.0
    total = jb.dynamics.energies(scene, motion.state).total
    np.testing.assert_allclose(total, total[0], atol=2e-6)


def _upright(speed_x=0.0, speed_z=0.0, height=0.0):
    """Both legs straight down, soles `height` above the ground."""
    return jb.State(*map(jnp.asarray, (0.0, 0.4 + height, 0.0, 0.0, speed_x, speed_z, 0.0, 0.0)))


def test_a_drop_on_the_hertz_law():
    """Largest penetration and rebound speed from the balance of energy, both feet at once."""
    scene = frictionless_walker(K=1e6, slope=0.0)
    drop = jb.simulate(scene, _upright(speed_z=-0.5), duration=0.05, accuracy="tight", watch=())
    times = np.linspace(0.0, 0.05, 20001)
    states = drop.at(times)
    depth = float(jnp.max(jb.dynamics.feet(scene, states)[0].penetration))
    # ½·2·v² + 2 g δ = 2·K δ^2.5/2.5
    assert depth**2.5 * 1e6 / 2.5 - 9.8 * depth == pytest.approx(0.5 * 0.5**2, rel=1e-6)
    leaving = int(np.flatnonzero(np.asarray(states.hip_z) > 0.4)[0])
    assert float(states.hip_vz[leaving]) == pytest.approx(0.5, abs=1e-4)


def _block(friction, slope):
    """Legs too heavy to turn slide like one block on two feet."""
    walker = jb.Walker(m=1.0, J=1e9, l=0.4, d=0.0, r=0.08)
    normal = jb.laws.RistowSchafer(K=1e6, c=1e6)
    return jb.Scene(walker, jb.Ground(slope=slope), normal, friction, jb.laws.AlwaysTouching())


BLOCK = dict(accuracy="tight", watch=(), save="end")
"""By lanes, which compile sooner; test_engines.py has them agree with XLA."""


def _final_speed(friction, slope, speed, duration):
    """Of a block, that slides on along its ground."""
    scene = _block(friction, slope)
    settled = _upright(speed_x=speed, height=-float((9.8 * np.cos(slope) / 1e6) ** (2 / 3)))
    return float(jb.simulate(scene, settled, duration=duration, **BLOCK).final.hip_vx)


def test_a_block_without_friction_slides_down_freely():
    speed = _final_speed(jb.laws.Frictionless(), 0.1, 0.2, 0.5)
    assert speed == pytest.approx(0.2 + 9.8 * np.sin(0.1) * 0.5, rel=1e-8)


def test_a_block_on_regularised_coulomb_friction():
    """v' = −μ g tanh(v/v_d) on the level: sinh(v/v_d) decays exponentially."""
    v_d, mu, t = 0.05, 0.4, 0.06
    speed = _final_speed(jb.laws.RegularisedCoulomb(mu=mu, v_d=v_d), 0.0, 0.3, t)
    expected = v_d * np.arcsinh(np.sinh(0.3 / v_d) * np.exp(-mu * 9.8 * t / v_d))
    assert speed == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("law", [jb.laws.BengisuAkay, jb.laws.SmoothBengisuAkay])
def test_a_block_on_bengisu_akay_friction(law):
    """Fast: the kinetic coefficient brakes it. On a slope: it creeps where F = m g sin α."""
    friction = law(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0)
    assert _final_speed(friction, 0.0, 0.5, 0.1) == pytest.approx(0.5 - 0.4 * 9.8 * 0.1, rel=1e-6)
    speed = _final_speed(friction, 0.1, 0.0, 0.1)
    if law is jb.laws.BengisuAkay:
        creep = 1e-4 * (1 - np.sqrt(1 - np.tan(0.1) / 0.5))
        assert speed == pytest.approx(creep, rel=1e-4)
    force = friction.force(jnp.asarray(9.8 * np.cos(0.1)), jnp.asarray(speed))
    assert float(force) == pytest.approx(-9.8 * np.sin(0.1), rel=1e-4)


@jax.jit
@functools.partial(jax.vmap, in_axes=(0, 0, None, None))
def _batch(angle, contact, duration, rtol):
    """Walks of eight lanes that differ in the first leg's angle and in K, c, v0 and ξ.

    Compiling it takes most of the time of the tests that run it: so it is one program for them.
    """
    scene = jb.seed_scene(**dict(zip(("K", "c", "v0", "xi"), contact, strict=True)))
    start = jb.seed_state()._replace(theta_1=angle)
    return jb.simulate(scene, start, duration=duration, rtol=rtol, save="end")


def test_a_bad_lane_ends_alone():
    """One lane that is no number and one that falls leave the others as they were."""
    good = [-0.2479, -0.2489, -0.2469]
    bad = [float("nan"), 0.9]
    contact = jnp.tile(jnp.array([1e6, 1e7, 1e-4, 1e3]), (8, 1))

    def run(angles):
        more = [good[0]] * (8 - len(angles))
        return _batch(jnp.array(angles + more), contact, 0.5, ACCURACIES["draft"].walk)

    alone, mixed = run(good), run(good + bad)
    kept = np.array(alone.final)[:, :3]
    np.testing.assert_allclose(kept, np.array(mixed.final)[:, :3], atol=1e-9)
    assert [jb.Ending(int(e)) for e in mixed.ending[:3]] == [jb.Ending.WALKING] * 3
    assert jb.Ending(int(mixed.ending[3])) == jb.Ending.SOLVER_FAILED
    attempts = mixed.attempted
    assert int(attempts[3]) < 30


def test_single_precision_is_the_users_choice_and_refused_where_too_coarse():
    start = jax.tree_util.tree_map(lambda leaf: leaf.astype(jnp.float32), jb.seed_state())
    walk = jb.simulate(jb.seed_scene(), start, duration=0.3, accuracy="draft", save="end")
    assert walk.final.theta_1.dtype == jnp.float32
    full = _walk(duration=0.3)
    np.testing.assert_allclose(np.array(walk.final), np.array(full.final), atol=2e-2)
    with pytest.raises(jb.ArgumentError, match=r"float32.*float64"):
        jb.simulate(jb.seed_scene(K=1e10), start, duration=0.3)


def test_compiling_apart_from_running():
    request = jb.Simulation.prepare(jb.seed_scene(), jb.seed_state(), duration=0.1, save="end")
    run = request.compile()
    same = _walk(duration=0.1)
    np.testing.assert_array_equal(np.array(run().final), np.array(same.final))


def test_extremes_of_the_contact_parameters():
    """Decades above and below the seed's: every lane is solved, and none slows the others."""
    cases = {
        "seed": (1e6, 1e7, 1e-4, 1e3),
        "soft": (1e4, 1e7, 1e-4, 1e3),
        "rigid": (1e12, 1e12, 1e-4, 1e3),
        "overdamped": (1e6, 1e10, 1e-4, 1e3),
        "sharp friction": (1e6, 1e7, 1e-6, 1e3),
        "blunt friction": (1e6, 1e7, 1e-2, 1e3),
        "abrupt Stribeck": (1e6, 1e7, 1e-4, 1e6),
        "no Stribeck decay": (1e6, 1e7, 1e-4, 0.0),
    }

    angles = jnp.full(len(cases), jb.seed_state().theta_1)
    ends = _batch(angles, jnp.array([*cases.values()]), 2.0, ACCURACIES["balanced"].walk)
    for name, ending, attempts in zip(cases, ends.ending, ends.attempted, strict=True):
        assert jb.Ending(int(ending)) == jb.Ending.WALKING, name
        assert int(attempts) < 40000, name


def test_derivatives_need_shorter_euler_steps_than_states():
    """At 1 µs friction makes the step itself unstable; its saturation saves the state alone."""

    @jax.jit
    @functools.partial(jax.vmap, in_axes=(0, None))
    def rise(change, dt):
        def end(change):
            scene = jb.with_parameters(jb.seed_scene(), {"c": 1e7 * (1.0 + change)})
            how = dict(solver="euler", dt=dt, save="end", watch=(), max_solver_steps=4096)
            forward = diffrax.ForwardMode()
            walk = jb.simulate(scene, jb.seed_state(), duration=8e-4, adjoint=forward, **how)
            return walk.final.hip_vz

        return jax.jvp(end, (change,), (jnp.ones_like(change),))

    changes = jnp.asarray([-1e-5, 0.0, 1e-5])
    found = {dt: rise(changes, jnp.asarray(dt)) for dt in (1e-6, 5e-7)}
    values, slopes = found[5e-7]
    assert float(slopes[1]) == pytest.approx(float(values[2] - values[0]) / 2e-5, rel=1e-5)
    assert float(found[1e-6][0][1]) == pytest.approx(float(values[1]), abs=1e-5)
    assert abs(float(found[1e-6][1][1])) > 1e3 * abs(float(slopes[1]))

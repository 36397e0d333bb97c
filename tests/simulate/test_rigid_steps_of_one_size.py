"""Rigid walks by steps of one size and by other solvers, against walks at a tight tolerance."""

import warnings

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.rigid_walkers import STABLE, rigid_seed, simplest_state, simplest_walker

WALKER, START = simplest_walker(), simplest_state(*STABLE)
SEED = rigid_seed()
ROLLING = jb.dynamics.RigidState(*map(jnp.asarray, (0.7, -0.25, 0.23, -1.0, -1.6)))


def off_of(scene, state, dt, **how):
    """Errors of times of heel strikes and of the final state."""
    truth = jb.simulate(scene, state, save=jb.HeelStrike(), accuracy="tight", **how)
    walk = jb.simulate(scene, state, save=jb.HeelStrike(), dt=dt, rtol=1e-12, **how)
    count = int(truth.arrivals.total)
    assert int(walk.arrivals.total) == count >= 2
    assert int(walk.rejected) == 0
    times = np.max(np.abs(walk.arrivals.t - truth.arrivals.t)[:count])
    ends = [abs(float(a - b)) for a, b in zip(walk.final, truth.final, strict=True)]
    return float(times), max(ends)


@pytest.mark.parametrize(
    ("scene", "state", "how", "longest"),
    [(WALKER, START, dict(footsteps=3), 0.8), (SEED, ROLLING, dict(duration=1.3), 0.12)],
)
def test_impacts_are_landed_on_and_errors_are_of_order_eight(scene, state, how, longest):
    errors = np.array([off_of(scene, state, longest / 2**k, **how) for k in range(3)])
    assert np.all(errors[0] < 1e-3)
    assert np.all(errors[2] < 3e-10)
    orders = np.log2(errors[0] / np.maximum(errors[1], 1e-13))
    assert np.all(orders > 6.5)


@pytest.mark.parametrize(
    ("solver", "order", "steps"),
    [("euler", 1, 4000), ("runge2", 2, 500), ("bosh3", 3, 250), ("tsit5", 5, 40)],
)
@pytest.mark.filterwarnings("ignore:dt = :RuntimeWarning")
def test_steps_by_other_solvers_have_errors_of_their_order(solver, order, steps):
    how = dict(duration=1.3, save="end")
    truth = jb.simulate(SEED, ROLLING, accuracy="tight", **how).final
    errors = []
    for count in (steps, 2 * steps):
        walk = jb.simulate(SEED, ROLLING, solver=solver, dt=1.3 / count, **how)
        assert count <= int(walk.accepted) <= count + 20  # an impact ends a step, and is landed on
        errors.append(max(abs(float(a - b)) for a, b in zip(walk.final, truth, strict=True)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.6)


@pytest.mark.parametrize("solver", ["bosh3", "tsit5", "dopri5", diffrax.Dopri8()])
@pytest.mark.parametrize(("scene", "state"), [(WALKER, START), (SEED, ROLLING)])
def test_other_solvers_keep_to_the_tolerance(solver, scene, state):
    how = dict(footsteps=2, save=jb.MidStance())
    truth = jb.simulate(scene, state, accuracy="tight", **how)
    walk = jb.simulate(scene, state, solver=solver, rtol=1e-7, **how)
    np.testing.assert_allclose(walk.t, truth.t, rtol=1e-5)
    for leaf, expected in zip(walk.final, truth.final, strict=True):
        np.testing.assert_allclose(leaf, expected, atol=1e-5)
    count = int(truth.arrivals.total)
    assert int(walk.arrivals.total) == count >= 1
    np.testing.assert_allclose(walk.arrivals.t[:count], truth.arrivals.t[:count], rtol=1e-5)


def test_an_error_is_judged_for_other_solvers_too():
    how = dict(duration=1.3, save="end")
    walk = jb.simulate(SEED, ROLLING, solver="tsit5", accuracy=1e-6, **how)
    truth = jb.simulate(SEED, ROLLING, accuracy="tight", **how)
    assert walk.error.met
    bars = walk.error.bars["state"]
    for leaf, expected, bar in zip(walk.final, truth.final, bars, strict=True):
        assert abs(float(leaf - expected)) <= float(bar[0])


def test_all_steps_are_of_that_size_but_those_that_an_event_ends():
    walk = jb.simulate(SEED, ROLLING, duration=1.3, dt=0.02, save="steps")
    t = np.asarray(walk.t)
    sizes, ends = np.diff(t), np.append(np.flatnonzero(np.diff(t) == 0.0) - 1, len(t) - 2)
    whole = np.delete(sizes, np.concatenate([ends, ends[:-1] + 1]))
    np.testing.assert_allclose(whole, 0.02, rtol=1e-9)
    assert np.all(sizes[ends] <= 0.02 * (1.0 + 1e-9))
    assert t[-1] == 1.3


def test_steps_may_be_traced_and_states_have_the_motions_derivatives():
    def final(dt, rate):
        begin = ROLLING._replace(omega_2=rate)
        return jb.simulate(SEED, begin, duration=1.3, dt=dt, save="end").final.theta_1

    plain = float(final(0.01, -1.6))
    assert float(jax.jit(final)(0.01, -1.6)) == pytest.approx(plain, rel=1e-12)
    batch = jax.vmap(final, (0, None))(jnp.array([0.01, 0.02]), -1.6)
    np.testing.assert_allclose(batch, plain, atol=1e-7)
    slope = float(jax.grad(final, argnums=1)(0.01, -1.6))
    differences = (final(0.01, -1.6 + 1e-6) - final(0.01, -1.6 - 1e-6)) / 2e-6
    assert slope == pytest.approx(float(differences), rel=1e-5)


def test_steps_that_are_too_long_are_told_once_and_good_ones_are_not():
    with pytest.warns(RuntimeWarning, match="dt = 3 is too long: with steps of") as told:
        jb.simulate(WALKER, START, duration=20.0, dt=3.0, save="end")
    assert len(told) == 1
    assert told[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        jb.simulate(SEED, ROLLING, duration=1.3, dt=0.02, save="end")


def test_a_walk_goes_on_beneath_a_fall_that_is_not_watched_for():
    fast = ROLLING._replace(omega_2=jnp.asarray(3.0))
    fallen = jb.simulate(SEED, fast, duration=0.5, save="end")
    assert fallen.outcome is jb.Ending.FELL_BACK
    at = float(fallen.t[-1])
    for watch in ((), ("stop", "stumble")):
        walk = jb.simulate(SEED, fast, duration=0.5, watch=watch, save=np.array([at, 0.5]))
        assert walk.outcome is jb.Ending.WALKING
        assert float(walk.t[-1]) == 0.5
        np.testing.assert_allclose(walk.state.theta_2[0], fallen.final.theta_2, atol=1e-6)
        # The stance leg alone is a conservative pendulum; both legs' energy stays.
        whole = jb.dynamics.energies(SEED, walk.state)
        total = whole.kinetic + whole.gravitational
        np.testing.assert_allclose(total, total[0], rtol=1e-5)
    watched = jb.simulate(SEED, fast, duration=0.5, watch=("fall",), save="end")
    assert int(watched.ending) == int(fallen.ending)

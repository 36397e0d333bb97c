"""Walks of the rigid walker, against known gaits, by both engines against each other."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from tests.rigid_walkers import STABLE, UNSTABLE, rigid_seed, simplest_state, simplest_walker

GAIT = jb.dynamics.RigidState(
    *map(jnp.asarray, (0.0, -0.23985297893, 0.23985297893, -1.08917987007, -1.64274847822))
)


def test_the_gait_goes_on():
    walk = jb.rigid_walk(rigid_seed(), GAIT, footsteps=5, max_arrivals=6, accuracy="tight")
    assert walk.outcome is jb.Ending.WALKING
    assert walk.engine == "lanes"
    times, states = walk.arrivals.t, walk.arrivals.state
    np.testing.assert_allclose(np.diff(np.asarray(times)[:5]), 0.443780329, atol=1e-8)
    np.testing.assert_allclose(np.diff(np.asarray(states.hip_x)[:5]), 0.190414759, atol=1e-8)
    np.testing.assert_allclose(np.asarray(states.theta_2)[:5], GAIT.theta_2, atol=1e-8)
    assert np.isinf(np.asarray(times)[5])
    assert float(walk.t[-1]) == float(times[4])


def test_a_walk_begins_where_its_start_is():
    start = GAIT._replace(hip_x=jnp.asarray(0.7), theta_2=jnp.asarray(0.15))
    speed = float(jb.dynamics.rolling_field(0.0, start, rigid_seed()).hip_x)
    walk = jb.rigid_walk(rigid_seed(), start, duration=1e-6, engine="lanes")
    assert float(walk.final.hip_x) == pytest.approx(0.7 + 1e-6 * speed, abs=1e-11)


def test_endings():
    def walk(omega, slope=0.02, **options):
        state = GAIT._replace(omega_2=jnp.asarray(omega))
        return jb.rigid_walk(rigid_seed(slope), state, **options)

    assert walk(-6.0, footsteps=5).outcome is jb.Ending.FELL_FORWARD
    assert walk(0.6, footsteps=5).outcome is jb.Ending.FELL_BACK
    assert walk(-0.6, 0.0, footsteps=5).outcome is jb.Ending.FELL_BACK
    for most in (20, 21):
        cut = walk(-1.6, footsteps=5, max_solver_steps=most)
        assert cut.outcome is jb.Ending.OUT_OF_STEPS
        assert int(cut.accepted) + int(cut.rejected) == most
    bounded = walk(-1.64274847822, duration=1.0)
    assert bounded.outcome is jb.Ending.WALKING
    assert (float(bounded.t[-1]), int(bounded.arrivals.total)) == (1.0, 2)


def test_a_walker_at_rest_waits_in_vain():
    """Upright on level ground, on feet that carry it there: no footstep comes in 50 √(l/g)."""
    walker = jb.Walker(m=1.0, J=0.01, l=0.4, d=0.3, r=0.35)
    scene = jb.RigidScene(walker=walker, ground=jb.Ground(slope=0.0))
    state = jb.dynamics.RigidState(*map(jnp.asarray, (0.0,) * 5))
    walk = jb.rigid_walk(scene, state, footsteps=1)
    assert walk.outcome is jb.Ending.TIMED_OUT
    assert int(walk.arrivals.total) == 0
    assert float(walk.t[-1]) == pytest.approx(50.0 * np.sqrt(0.4 / 9.8), rel=1e-12)
    assert [float(leaf) for leaf in walk.final] == [0.0] * 5


@pytest.mark.slow
@settings(deadline=None, max_examples=8)
@given(st.lists(st.floats(-0.3, 0.3, allow_subnormal=False), min_size=4, max_size=4))
def test_engines_agree(moves):
    state = jb.dynamics.RigidState(
        GAIT.hip_x, *[leaf + d for leaf, d in zip(GAIT[1:], moves, strict=True)]
    )
    first, second = (
        jb.rigid_walk(
            rigid_seed(), state, footsteps=2, max_arrivals=2, accuracy="tight", engine=engine
        )
        for engine in ("lanes", "xla")
    )
    assert first.outcome is second.outcome
    struck, again = first.arrivals, second.arrivals
    assert int(struck.total) == int(again.total)
    # A fall is seen at the end of a step, and the steps differ by rounding: heel strikes do not.
    for ours, theirs in zip(*map(jax.tree.leaves, (struck, again)), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-7)
    if first.outcome is jb.Ending.WALKING:
        np.testing.assert_allclose(np.array(first.final), np.array(second.final), atol=1e-7)


def test_it_is_what_simulate_gives():
    how = dict(footsteps=2, max_arrivals=3, accuracy="draft")
    walk = jb.simulate(rigid_seed(), GAIT, save=jb.HeelStrike(), **how)
    assert jax.tree.all(
        jax.tree.map(np.array_equal, walk, jb.rigid_walk(rigid_seed(), GAIT, **how))
    )


def test_error_follows_the_tolerance():
    tolerances = np.array([1e-4, 1e-6, 1e-8])
    ends = [
        np.array(jb.rigid_walk(rigid_seed(), GAIT, footsteps=4, rtol=rtol).final)
        for rtol in (1e-12, *tolerances)
    ]
    errors = np.abs(np.stack(ends[1:]) - ends[0]).max(axis=1)
    assert np.all(errors < tolerances)
    assert errors[2] < errors[1] < errors[0]


def test_steady_footsteps_need_no_search_for_their_strikes():
    few, many = (jb.rigid_walk(rigid_seed(), GAIT, footsteps=steps, rtol=1e-4) for steps in (3, 23))
    assert int(many.attempted - few.attempted) / 20 <= int(few.attempted) / 3 - 0.5
    exact = jb.rigid_walk(rigid_seed(), GAIT, footsteps=23, rtol=1e-12)
    assert float(many.t[-1]) == pytest.approx(float(exact.t[-1]), rel=1e-5)
    np.testing.assert_allclose(np.array(many.final[1:]), np.array(exact.final[1:]), atol=1e-4)


def test_batches_and_bad_lanes():
    """A lane that is no number fails alone; the others' bits are those of a single walk."""
    count = 37
    omega = GAIT.omega_2 + jnp.linspace(-0.1, 0.1, count)
    omega = omega.at[5].set(jnp.nan)

    def walk(w):
        return jb.rigid_walk(rigid_seed(), GAIT._replace(omega_2=w), footsteps=3, engine="lanes")

    many = jax.jit(jax.vmap(walk))(omega)
    codes = np.asarray(many.ending)
    assert codes[5] == int(jb.Ending.SOLVER_FAILED)
    assert np.all(np.delete(codes, 5) == 0)
    assert float(many.t[9, -1]) == float(walk(omega[9]).t[-1])


def test_a_strike_is_found_though_the_legs_opened_just_before_the_step():
    # A long step from just behind the scuff at mid-stance, which is the course's nearer root.
    scene, start = simplest_walker(0.004), simplest_state(0.5670886075949367, -0.6)
    for rtol in (1e-4, 1e-6, 1e-9):
        assert str(jb.rigid_walk(scene, start, footsteps=30, rtol=rtol).outcome) == "fell back"


def test_the_simplest_walkers_gaits_attract_and_repel():
    scene = simplest_walker(0.009)
    near = lambda published, d: simplest_state(published[0] + d, published[1])
    settled = jb.rigid_walk(scene, near(STABLE, 1e-3), footsteps=60)
    assert float(settled.final.theta_2) == pytest.approx(STABLE[0], abs=1e-7)
    left = jb.rigid_walk(scene, near(UNSTABLE, 1e-6), footsteps=30)
    assert abs(float(left.final.theta_2) - UNSTABLE[0]) > 1e-3

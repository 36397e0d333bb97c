"""Located endings, against the surfaces that they lie on and arrivals found by bisection."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.hybrid._endings import (
    WATCHES,
    ending_events,
    ending_surface,
    fall_height,
)
from jaxbiped.hybrid._scales import units_of
from jaxbiped.solve.controllers._event_steps import LocatedEnding
from jaxbiped.solve.controllers._step_size import ErrorControl

pytestmark = pytest.mark.slow

SEED = jb.seed_scene()


@pytest.mark.parametrize("accuracy", ["draft", "tight"])
def test_a_fall_ends_where_the_hip_is_too_low(accuracy):
    scene = jb.seed_scene(slope=0.06)
    for save in ("end", "steps"):
        walk = jb.simulate(scene, jb.seed_state(), duration=9.0, save=save, accuracy=accuracy)
        assert walk.outcome is jb.Ending.FELL_FORWARD
        below = float(fall_height(scene) - walk.final.hip_z)
        assert 0.0 < below < 1e-9


@pytest.mark.parametrize("share", [0.2, 0.9])
def test_a_step_that_falls_is_tried_again_to_just_past_the_fall(share):
    """The hip sinks steadily to its lowest height at this share of the step."""
    start, span, sinks = 0.25, 1e-2, 1e-4
    high = jb.seed_state()._replace(hip_z=fall_height(SEED) + share * sinks)
    high = jax.tree.map(jnp.asarray, high)
    low = high._replace(hip_z=high.hip_z - sinks)
    control = LocatedEnding(
        ErrorControl(1.0, 1.0, units_of(SEED, high)), jb.hybrid.Walking(), ("fall",)
    )
    error = jax.tree.map(jnp.zeros_like, high)
    keep, begin, end, *_ = control.adapt_step_size(
        jnp.asarray(start), jnp.asarray(start + span), high, low, SEED, error, 4, jnp.asarray(False)
    )
    assert not bool(keep)
    assert float(begin) == start
    assert 0.0 < float(end) - (start + share * span) < 1e-11


def test_the_last_footstep_ends_at_the_heel_strike():
    how = dict(save=jb.HeelStrike(), accuracy="tight")
    walk = jb.simulate(SEED, jb.seed_state(), footsteps=3, **how)
    assert float(walk.t[-1]) == pytest.approx(float(walk.arrivals.t[2]), abs=1e-9)


def test_where_an_ending_has_come_its_surface_is_passed():
    rng, n = np.random.default_rng(5), 4000
    seed = jb.seed_state()
    wide = jax.tree.map(lambda leaf: leaf + 0.3 * rng.standard_normal(n), seed)
    # Feet about the ground and slow legs, where endings are.
    states = wide._replace(
        hip_z=0.2 + 0.22 * rng.random(n), omega_1=wide.omega_1 * 10.0 ** rng.uniform(-6, 0, n)
    )

    @jax.vmap
    def told(y):
        codes = {
            int(name): happens(0.0, y, SEED) for name, happens in ending_events(WATCHES).items()
        }
        return {code: (has, ending_surface(code, SEED, y, y)) for code, has in codes.items()}

    all_of = jax.jit(told)
    for place in (-5.0, 5.0):  # they are the same wherever on the slope the walker is
        there = all_of(states._replace(hip_x=states.hip_x + place))
        for code, (_, value) in all_of(states).items():
            np.testing.assert_allclose(there[code][1], value, atol=1e-12, err_msg=str(code))
    for code, (has, value) in all_of(states).items():
        if code != int(jb.Ending.SOLVER_FAILED):
            assert np.sum(has) > 0 or code == int(jb.Ending.STUMBLED)
            assert np.all(np.asarray(value)[np.asarray(has)] > 0.0), jb.Ending(code)
    assert np.all(np.isnan(ending_surface(jnp.asarray(6), SEED, seed, seed)))

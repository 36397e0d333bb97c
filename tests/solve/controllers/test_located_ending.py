"""Located endings, against the surfaces that they lie on and arrivals found by bisection."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.solve._failure_events import WATCHES, ending_events, ending_surface, fall_height

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

    for code, (has, value) in jax.jit(told)(states).items():
        if code != int(jb.Ending.SOLVER_FAILED):
            assert np.sum(has) > 0 or code == int(jb.Ending.STUMBLED)
            assert np.all(np.asarray(value)[np.asarray(has)] > 0.0), jb.Ending(code)
    assert np.all(np.isnan(ending_surface(jnp.asarray(6), SEED, seed, seed)))

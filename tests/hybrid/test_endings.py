"""Every ending by its name, against walks that end so."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.compliant_walkers import astride_at_rest, held_walker, seed_state

Ending = jb.Ending


def _walk(slope, **options):
    options = {"duration": 20.0, "save": "end"} | options
    return jb.simulate(jb.seed_scene(slope=slope), jb.seed_state(), **options)


@pytest.mark.parametrize(
    ("slope", "ending"),
    [
        (0.005, Ending.STOPPED),
        (0.030, Ending.WALKING),
        (0.035, Ending.FELL_FORWARD),
        (0.060, Ending.FELL_FORWARD),
    ],
)
def test_the_seed_start_on_other_slopes(slope, ending):
    walk = _walk(slope)
    assert walk.outcome == ending
    if ending == Ending.STOPPED:
        assert float(walk.final.hip_z) > 0.39  # recognised before it sinks


def test_it_still_walks_after_a_hundred_footsteps():
    walk = _walk(0.02, duration=None, footsteps=100)
    assert walk.outcome == Ending.WALKING
    assert float(walk.t[-1]) == pytest.approx(0.3932 + 99 * 0.44083, abs=0.05)


def test_out_of_steps():
    rejected = set()
    for most in range(2, 22):  # attempts are counted one by one, whatever becomes of them
        walk = _walk(0.02, max_solver_steps=most)
        assert walk.outcome == Ending.OUT_OF_STEPS
        assert int(walk.accepted) + int(walk.rejected) == most
        rejected.add(int(walk.rejected))
    assert len(rejected) > 1
    few = _walk(0.02, duration=None, footsteps=100, max_solver_steps=50)
    assert few.outcome == Ending.OUT_OF_STEPS


def test_waiting_in_vain_is_not_the_cap_on_steps():
    """Let down on both feet, nothing ever comes down again."""
    scene, start = astride_at_rest()
    options = {"save": "end", "watch": ("fall",)}
    waiting = jb.simulate(scene, start, footsteps=1, **options)
    assert waiting.outcome is Ending.TIMED_OUT
    assert float(waiting.t[-1]) == 100.0
    capped = jb.simulate(scene, start, footsteps=1, max_solver_steps=5, **options)
    assert capped.outcome is Ending.OUT_OF_STEPS
    bounded = jb.simulate(scene, start, footsteps=1, duration=1.0, **options)
    assert bounded.outcome is Ending.WALKING


def test_fell_back():
    """Both feet far ahead of a hip that moves uphill, on ground that always holds."""
    start = seed_state(
        theta_1=0.6, theta_2=0.65, omega_1=1.5, omega_2=1.5, hip_vx=-0.5, hip_vz=-0.3,
        hip_z=0.08 + 0.32 * 0.8253,
    )  # fmt: skip
    fall = jb.simulate(held_walker(), start, duration=2.0, save="end", watch=("fall",))
    assert fall.outcome == Ending.FELL_BACK
    assert float(fall.final.hip_vx) < 0.0


def test_stopped_on_ground_that_always_holds():
    """Let down on both feet, legs astride, it comes to rest and is told so."""
    rest = jb.simulate(*astride_at_rest(), duration=50.0, save="end")
    assert rest.outcome == Ending.STOPPED
    assert float(rest.t[-1]) < 50.0


def test_a_scuffing_foot_is_a_stumble():
    """Without the clearance rule the swinging foot catches the ground at mid-stance."""
    scene = held_walker()
    walk = jb.simulate(scene, jb.seed_state(), duration=2.0, save="end")
    assert walk.outcome == Ending.STUMBLED
    unwatched = jb.simulate(scene, jb.seed_state(), duration=0.3, save="end", watch=("fall",))
    assert unwatched.outcome == Ending.WALKING


def test_of_failures_that_hold_together_the_first_is_the_ending():
    """At random motions low above the ground, where often several do."""
    scene, rng, names = jb.seed_scene(), np.random.default_rng(3), jb.seed_state()._fields
    system = jb.hybrid.Walking()
    values = dict(zip(names, rng.normal(0.0, 0.4, (len(names), 200)), strict=True))
    states = jb.State(**values | {"hip_z": rng.uniform(0.15, 0.35, 200)})
    failures = system.failures(system.watches)

    def ask(state):
        holds = [happens(0.0, state, scene) for happens in failures.values()]
        return system.ending(scene, state), jnp.stack(holds)

    codes, holds = map(np.asarray, jax.jit(jax.vmap(ask))(states))
    first = np.array([int(name) for name in failures])[np.argmax(holds, axis=1)]
    np.testing.assert_array_equal(codes, np.where(np.any(holds, axis=1), first, 0))
    assert np.sum(np.sum(holds, axis=1) > 1) >= 10


def test_names_in_words():
    failures = "fell forward, fell back, stopped, stumbled, out of steps, solver failed"
    names = [str(ending) for ending in Ending]
    assert names == ["walking", *failures.split(", "), "timed out", "finished", "chatters"]
    assert [int(ending) for ending in Ending] == [0, 1, 2, 3, 4, 5, 6, 9, 10, 11]

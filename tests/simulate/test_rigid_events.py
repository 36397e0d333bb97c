"""Heel strikes and falls of the rigid walker, against own equations solved in small steps."""

import dataclasses

import jax
import numpy as np
import pytest
from reference.rigid_walks import rigid_walks

import jaxbiped as jb
from jaxbiped.models import hsu_chen
from tests.rigid_walkers import rigid_seed

SEED = jb.seed_scene().walker
SPRING = jb.actuation.HipSpring(k=3.0)
PUSH = jb.actuation.PushOff(impulse=0.15)
WALKERS = {
    "seed": (SEED, 0.02, None, {}),
    "gentle slope": (SEED, 0.003, None, {}),
    "hip": (jb.Walker(m=0.5, J=0.003, l=1.0, d=0.4, r=0.1, hip_mass=5.0), 0.03, None, {}),
    "point feet": (jb.Walker(m=5.0, J=0.0, l=1.0, d=0.5, r=0.0, hip_mass=10.0), 0.05, None, {}),
    "large feet": (jb.Walker(m=1.0, J=0.01, l=0.4, d=0.3, r=0.35), 0.01, None, {}),
    "spring": (SEED, 0.02, SPRING, {"torques": lambda y: 3.0 * (y[[1, 0]] - y[:2])}),
    "push-off": (SEED, 0.0, PUSH, {"push_off": 0.15}),
}  # fmt: skip
FOOTSTEPS, NIGHTLY = 3, [pytest.mark.nightly]


def _scene(name):
    walker, slope, actuator, _ = WALKERS[name]
    actuation = None if actuator is None else (actuator,)
    return jb.RigidScene(walker=walker, ground=jb.Ground(slope=slope), actuation=actuation)


def _starts(scene, count, seed=0):
    """Anywhere: legs that swing forward or back, fast or slowly, on either side of the other."""
    random = np.random.default_rng(seed)
    pace = np.sqrt(float(scene.ground.g) / float(scene.walker.l))
    uniform = lambda most: random.uniform(-most, most, count)
    angles = uniform(0.8), uniform(0.6)
    return jb.dynamics.RigidState(
        np.zeros(count), *angles, pace * uniform(1.2), pace * uniform(0.6)
    )


def _walker_of(scene, duration):
    def walk(state, rtol):
        return jb.rigid_walk(
            scene, state, footsteps=FOOTSTEPS, duration=duration, max_arrivals=FOOTSTEPS,
            rtol=rtol, engine="lanes",
        )  # fmt: skip

    return jax.jit(jax.vmap(walk, in_axes=(0, None)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in ("seed", "point feet", "push-off") else NIGHTLY)
        for name in WALKERS
    ],
)
def test_strikes_and_falls_are_those_of_small_steps(name):
    scene = _scene(name)
    unit = float(np.sqrt(scene.walker.l / scene.ground.g))
    starts, end = _starts(scene, 200), 8.0 * unit
    true = rigid_walks(scene, starts, FOOTSTEPS, duration=8.0, **WALKERS[name][3])
    walk_of = _walker_of(scene, end)
    expected = np.where(true.strikes < end, true.strikes, np.inf)
    for rtol in (1e-4, 1e-6, 1e-11):
        walk = walk_of(starts, rtol)
        times = np.asarray(walk.arrivals.t)
        graze = np.asarray(walk.grazes) > 0
        assert np.all((times[:, 1:] > times[:, :-1]) | np.isinf(times[:, 1:]))
        assert np.mean(graze) <= 100.0 * rtol
        both = np.isfinite(times) & np.isfinite(expected)
        same = np.isfinite(times) == np.isfinite(expected)
        assert np.all(same | graze[:, None])
        off = np.abs(np.where(both, times, 0.0) - np.where(both, expected, 0.0)) / unit
        assert np.all((off <= 100.0 * rtol + 1e-9) | graze[:, None])
        assert np.sum(np.any(off > 100.0 * rtol + 1e-9, axis=1) | ~same.all(axis=1)) <= 1
        # Falls, of those whose strikes are settled.
        fell = (true.falls < end) & ~graze
        codes = np.asarray(walk.ending)
        np.testing.assert_array_equal(codes[~graze] > 0, fell[~graze])
        np.testing.assert_array_equal(codes[fell] == 1, true.last[fell, 1] < 0.0)
        late = np.abs(np.asarray(walk.t)[fell, -1] - true.falls[fell]) / unit
        assert np.max(late) <= 1000.0 * rtol + 1e-9


# Swing leg's angle and rate: it swings back fast, and is behind again where a step ends.
BACK = [(0.7936, -3.9896), (0.5787, -2.2768), (0.4209, -1.8128)]


@pytest.mark.parametrize(("angle", "rate"), BACK)
def test_a_leg_that_swings_back_has_struck_first(angle, rate):
    scene = rigid_seed()
    start = jb.dynamics.RigidState(0.0, angle, 0.23985298, rate, -1.64274848)
    true = rigid_walks(scene, start, 1)
    assert np.isfinite(true.strikes[0, 0])
    for wanted in (1e-4, 1e-6):
        walk = jb.rigid_walk(scene, start, footsteps=3, max_arrivals=3, accuracy=wanted)
        error = abs(float(walk.arrivals.t[0]) - true.strikes[0, 0])
        assert walk.error.met
        assert error <= float(walk.error.bars["arrivals"].t[0]) + 1e-12


def test_a_leg_that_is_behind_at_the_root_has_not_struck():
    start = jb.dynamics.RigidState(0.0, 0.0587, 0.23985298, -1.0143, -1.64274848)
    assert np.isinf(rigid_walks(rigid_seed(), start, 1).strikes[0, 0])
    for rtol in (1e-4, 1e-6, 1e-11):
        walk = jb.rigid_walk(rigid_seed(), start, footsteps=1, rtol=rtol)
        assert walk.outcome is jb.Ending.FELL_FORWARD
        assert int(walk.arrivals.total) == 0


def test_a_walker_that_rocks_beyond_1_rad_has_fallen_within_the_step():
    """On large feet it would come back, and strike later."""
    scene = _scene("large feet")
    start = jb.dynamics.RigidState(0.0, -0.233, 0.1772, -5.4597, -1.1438)
    true = rigid_walks(scene, start, 1)
    for rtol in (1e-4, 1e-6):
        walk = jb.rigid_walk(scene, start, footsteps=2, rtol=rtol)
        assert walk.outcome is jb.Ending.FELL_BACK
        assert float(walk.t[-1]) == pytest.approx(true.falls[0], abs=100.0 * rtol)


def test_a_foot_that_grazes_the_ground_is_told():
    """Between starts that strike and starts that are behind by then, found by small steps."""
    scene, low, high = rigid_seed(), -2.5, -1.5
    states = lambda rates: jb.dynamics.RigidState(0.0, 0.4209, 0.23985298, rates, -1.64274848)
    for _ in range(4):
        rates = np.linspace(low, high, 17)
        strikes = np.isfinite(rigid_walks(scene, states(rates), 1, duration=1.0).strikes[:, 0])
        last = int(np.flatnonzero(strikes != strikes[0])[0])
        low, high = rates[last - 1], rates[last]
    between = float(0.5 * (low + high))
    assert int(jb.rigid_walk(scene, states(between), footsteps=1, rtol=1e-4).grazes) > 0
    for rate in (low - 0.1, high + 0.1):
        assert int(jb.rigid_walk(scene, states(rate), footsteps=1, rtol=1e-4).grazes) == 0


@pytest.mark.parametrize(
    ("name", "start"),
    [
        ("seed", (0.1887, -0.1014, -3.7796, 2.3404)),
        ("point feet", (0.6564, -0.1274, -3.1428, 1.1597)),
        ("large feet", (0.5016, -0.5932, 5.3215, -2.1858)),
    ],
)
def test_a_return_is_asked_at_the_root_and_a_fall_comes_first(name, start):
    """A leg that is ahead before the root or behind it alone; a fall just before a strike."""
    scene, state = _scene(name), jb.dynamics.RigidState(0.0, *start)
    true = rigid_walks(scene, state, 1)
    assert np.isfinite(true.falls[0])
    assert np.isinf(true.strikes[0, 0])
    assert int(jb.return_map(scene, state).code) in (1, 2)


@pytest.mark.slow
@pytest.mark.parametrize("holds", ["until heel strike", "through heel strike"])
def test_knees_hit_and_feet_strike_as_at_tight(holds):
    """Straight legs that swing back pass each other level; a knee let go may hit again at once."""
    scene = hsu_chen()
    scene = jb.RigidScene(dataclasses.replace(scene.walker, holds=holds), scene.ground)
    draws = np.random.default_rng(5).uniform(-1.0, 1.0, (5, 400))
    swing, stance, bend = 0.1 * draws[0] - 0.24, 0.1 * draws[2] + 0.24, 0.3 * np.abs(draws[1])
    rate, standing = 1.5 * draws[3] - 0.06, 0.5 * draws[4] - 1.11
    starts = scene.state(
        theta_thigh_1=swing, theta_shank_1=swing - bend, theta_thigh_2=stance, theta_shank_2=stance,
        omega_thigh_1=rate, omega_shank_1=rate - 2.0 * draws[1], omega_thigh_2=standing,
        omega_shank_2=standing, held="shank_2",
    )  # fmt: skip

    def walked(accuracy):
        def one(start):
            walk = jb.simulate(scene, start, footsteps=2, duration=6.0, accuracy=accuracy)
            return walk.t[-1], walk.ending, walk.final.mode, walk.grazes

        return [np.asarray(each) for each in jax.vmap(one)(starts)]

    (t, *found, grazes), (true, *expected, _) = walked("balanced"), walked("tight")
    same = (grazes > 0) | (np.abs(t - true) < 1e-4)
    for ours, theirs in zip(found, expected, strict=True):
        same &= (grazes > 0) | (ours == theirs)
    assert np.all(same)
    assert np.mean(grazes > 0) < 0.02

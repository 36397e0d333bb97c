"""Walks to a wanted accuracy, against closed forms, finest solves and equations written again."""

import jax
import numpy as np
import pytest
from reference.rigid_walks import rigid_walks
from reference.scipy_solves import final_of

import jaxbiped as jb
from tests.rigid_walkers import STABLE, rigid_seed, simplest_state, simplest_walker

SCENE, STATE = jb.seed_scene(), jb.seed_state()
START = jb.dynamics.rigid_state(STATE)


def _numbers(walk):
    return np.array([float(x) for x in (*walk.final, walk.t[-1])])


def _bars(walk):
    bars = walk.error.bars
    return np.array([float(x[-1]) for x in (*bars["state"], bars["t"])])


@pytest.fixture(scope="module")
def walk():
    return jb.simulate(SCENE, STATE, duration=0.1, accuracy=1e-4, save="end", engine="lanes")


@pytest.mark.slow
def test_the_bars_hold_the_error_against_equations_written_again(walk):
    exact, bars = final_of(0.1, 1e-9), _bars(walk)[:-1]
    assert walk.error.met
    assert walk.error.relative <= 1e-4
    # The reference's own error is of the order of 1e-8.
    assert np.all(np.abs(_numbers(walk)[:-1] - exact) <= bars + 1e-7)
    assert np.max(bars) > 1e-8


@pytest.mark.slow
def test_it_is_the_plain_walk_at_the_tolerance_used(walk):
    plain = jb.simulate(
        SCENE, STATE, duration=0.1, rtol=walk.error.rtol, save="end", engine="lanes"
    )
    assert plain.error is None
    np.testing.assert_array_equal(_numbers(plain), _numbers(walk))


@pytest.mark.slow
def test_every_step_has_its_bar_and_none_lies_far_below_the_others_of_its_moment():
    """In units of l, √(l/g) and their quotients; a witness's difference may vanish by accident."""
    walk = jb.simulate(SCENE, STATE, duration=0.1, accuracy=1e-3, engine="lanes")
    bars = walk.error.bars["state"]
    assert all(bar.shape == leaf.shape for bar, leaf in zip(bars, walk.state, strict=True))
    assert all(float(bar[0]) == 0.0 for bar in bars)
    unit = np.sqrt(0.4 / 9.8)
    sizes = np.array([0.4, 0.4, 1.0, 1.0, 0.4 / unit, 0.4 / unit, 1.0 / unit, 1.0 / unit])
    bars = np.stack(bars) / sizes[:, None]
    assert np.all(bars.min(axis=0) >= 0.05 * bars.max(axis=0) * (1.0 - 1e-12))
    assert np.any(bars.min(axis=0) > 0.0)


@pytest.mark.slow
def test_what_cannot_be_met_is_told_with_what_was_reached():
    with pytest.warns(RuntimeWarning, match="accuracy = 1e-16 is not met"):
        walk = jb.simulate(SCENE, STATE, duration=0.1, accuracy=1e-16, save="end", engine="lanes")
    assert not walk.error.met
    assert 1e-16 < walk.error.relative < 1e-6
    assert walk.error.reason


@pytest.mark.nightly
def test_single_precision_ends_at_its_own_floor():
    soft = jb.seed_scene(K=1e4, c=1e4)
    start = jax.tree.map(lambda leaf: np.float32(leaf), STATE)
    with pytest.warns(RuntimeWarning, match="is not met"):
        walk = jb.simulate(soft, start, duration=0.05, accuracy=1e-9, save="end", engine="xla")
    assert walk.error.rtol >= 32 * np.finfo(np.float32).eps
    assert walk.t.dtype == np.float32


@pytest.mark.parametrize("wanted", [1e-3, 1e-6, 1e-9])
def test_the_bars_hold_the_closed_form_of_a_footstep(wanted):
    """Energy is kept in single support, and an impact leaves cos 2θ of the stance leg's rate."""
    slope = 0.009
    start = simplest_state(STABLE[0] + 3e-3, STABLE[1])
    walk = jb.rigid_walk(simplest_walker(slope), start, footsteps=1, accuracy=wanted)
    energy = 0.5 * float(start.omega_2) ** 2 + np.cos(float(start.theta_2) - slope)
    theta, omega = float(walk.final.theta_2), float(walk.final.omega_2)

    def rate(angle):
        return -np.cos(2.0 * angle) * np.sqrt(2.0 * (energy - np.cos(angle + slope)))

    assert walk.error.met
    bars = {name: float(bar[-1]) for name, bar in walk.error.bars["state"]._asdict().items()}
    slope_of_rate = (rate(theta + 1e-6) - rate(theta - 1e-6)) / 2e-6
    bar = bars["omega_2"] + abs(slope_of_rate) * bars["theta_2"]
    assert abs(omega - rate(theta)) <= bar + 1e-13
    assert bar <= 10.0 * wanted


def test_the_bars_hold_the_finest_solves_of_random_scenes():
    random = np.random.default_rng(11)
    around = lambda value, most: float(value * most ** random.uniform(-1.0, 1.0))
    held, ratios = [], []
    for _ in range(50):
        walker = jb.Walker(
            m=1.0, J=around(0.0096, 1.5), l=0.4, d=around(0.1, 1.2), r=around(0.08, 1.3)
        )
        scene = jb.RigidScene(walker=walker, ground=jb.Ground(slope=around(0.02, 1.2)))
        state = START._replace(omega_1=START.omega_1 + random.uniform(-0.2, 0.2))
        walk, exact = (
            jb.rigid_walk(scene, state, duration=1.5, **how)
            for how in (dict(accuracy=10.0 ** random.uniform(-8.0, -2.0)), dict(rtol=1e-14))
        )
        assert walk.error.met
        assert walk.outcome is exact.outcome
        if walk.outcome is jb.Ending.WALKING:
            errors = np.abs(_numbers(walk) - _numbers(exact))[:5]
            held += list(errors <= _bars(walk)[:5] + 1e-12)
            ratios += list(_bars(walk)[:5] / np.maximum(errors, 1e-15))
    assert len(held) > 100
    assert np.mean(held) >= 0.95
    assert np.median(ratios) <= 30.0


def test_it_is_the_plain_walk_at_the_tolerance_used_and_strikes_have_bars():
    how = dict(footsteps=3, max_arrivals=5)
    walk = jb.rigid_walk(rigid_seed(), START, accuracy=1e-5, **how)
    plain = jb.rigid_walk(rigid_seed(), START, rtol=walk.error.rtol, **how)
    assert plain.error is None
    np.testing.assert_array_equal(_numbers(walk), _numbers(plain))
    bars = walk.error.bars["arrivals"]
    assert float(bars.total) == 0.0
    assert np.all(np.asarray(bars.t)[:3] > 0.0)
    assert np.all(np.asarray(bars.t)[:3] <= 1e-5 * np.sqrt(0.4 / 9.8))
    np.testing.assert_array_equal(np.asarray(bars.t)[3:], 0.0)


@pytest.mark.parametrize(("rate", "ending"), [(-6.0, "fell forward"), (0.6, "fell back")])
def test_a_fall_comes_where_the_stance_leg_is_1_rad_from_upright_and_has_bars(rate, ending):
    start = START._replace(omega_2=np.asarray(rate))
    walk = jb.rigid_walk(rigid_seed(), start, footsteps=5, accuracy=1e-7)
    assert str(walk.outcome) == ending
    assert walk.error.met
    true = rigid_walks(rigid_seed(), start, 5)
    exact = np.array([*true.last[0], true.falls[0]])
    assert abs(float(walk.final.theta_2)) == pytest.approx(1.0, abs=1e-12)
    assert np.all(np.abs(_numbers(walk)[1:] - exact) <= _bars(walk)[1:] + 1e-12)


def test_what_a_rigid_walk_cannot_meet_is_told_with_what_was_reached():
    with pytest.warns(RuntimeWarning, match="accuracy = 1e-16 is not met"):
        walk = jb.rigid_walk(rigid_seed(), START, footsteps=2, accuracy=1e-16)
    assert not walk.error.met
    assert 1e-16 < walk.error.relative < 1e-10
    with pytest.warns(RuntimeWarning, match="the solve ended as out of steps"):
        short = jb.rigid_walk(rigid_seed(), START, footsteps=9, accuracy=1e-6, max_solver_steps=20)
    assert np.isinf(short.error.relative)

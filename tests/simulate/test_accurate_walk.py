"""Walks to a wanted accuracy, against equations written again."""

import jax
import numpy as np
import pytest
from reference.scipy_solves import final_of

import jaxbiped as jb

SCENE, STATE = jb.seed_scene(), jb.seed_state()
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def walk():
    return jb.simulate(SCENE, STATE, duration=0.1, accuracy=1e-4, save="end", engine="lanes")


def test_the_bars_hold_the_error_against_equations_written_again(walk):
    exact = final_of(0.1, 1e-9)
    told = np.array([float(leaf) for leaf in walk.final])
    bars = np.array([float(leaf[-1]) for leaf in walk.error.bars["state"]])
    assert walk.error.met
    assert walk.error.relative <= 1e-4
    # The reference's own error is of the order of 1e-8.
    assert np.all(np.abs(told - exact) <= bars + 1e-7)
    assert np.max(bars) > 1e-8


def test_it_is_the_plain_walk_at_the_tolerance_used(walk):
    plain = jb.simulate(
        SCENE, STATE, duration=0.1, rtol=walk.error.rtol, save="end", engine="lanes"
    )
    assert plain.error is None
    assert [float(x) for x in plain.final] == [float(x) for x in walk.final]


def test_every_step_has_its_bar():
    walk = jb.simulate(SCENE, STATE, duration=0.1, accuracy=1e-3, engine="lanes")
    bars = walk.error.bars["state"]
    assert all(bar.shape == leaf.shape for bar, leaf in zip(bars, walk.state, strict=True))
    assert all(float(bar[0]) == 0.0 for bar in bars)


def test_no_bar_lies_far_below_the_others_of_its_moment():
    """In units of l, √(l/g) and their quotients; a witness's difference may vanish by accident."""
    walk = jb.simulate(SCENE, STATE, duration=0.1, accuracy=1e-3, engine="lanes")
    unit = np.sqrt(0.4 / 9.8)
    sizes = np.array([0.4, 0.4, 1.0, 1.0, 0.4 / unit, 0.4 / unit, 1.0 / unit, 1.0 / unit])
    bars = np.stack(walk.error.bars["state"]) / sizes[:, None]
    assert np.all(bars.min(axis=0) >= 0.05 * bars.max(axis=0) * (1.0 - 1e-12))
    assert np.any(bars.min(axis=0) > 0.0)


def test_what_cannot_be_met_is_told_with_what_was_reached():
    with pytest.warns(RuntimeWarning, match="accuracy = 1e-16 is not met"):
        walk = jb.simulate(SCENE, STATE, duration=0.1, accuracy=1e-16, save="end", engine="lanes")
    assert not walk.error.met
    assert 1e-16 < walk.error.relative < 1e-6
    assert walk.error.reason


@pytest.mark.parametrize(
    ("how", "words"),
    [
        (dict(accuracy=0.0), "accuracy = 0 is not allowed"),
        (dict(accuracy=-1), "accuracy = -1 is not allowed"),
        (dict(accuracy=float("nan")), "accuracy = nan is not allowed"),
        (dict(accuracy="fine"), "accuracy = 'fine' is not known: choose one of draft"),
        (dict(accuracy=True), "accuracy = True is not a number"),
        (dict(accuracy=1e-3, rtol=1e-6), "rtol = 1e-06 is not allowed beside accuracy = 0.001"),
        (dict(accuracy=1e-3, dt=1e-6), "dt = 1e-06 is not allowed beside accuracy"),
    ],
)
def test_bad_accuracies_cost_one_sentence(how, words):
    with pytest.raises(jb.ArgumentError, match=words):
        jb.simulate(SCENE, STATE, duration=0.1, **how)


def test_a_number_is_refused_where_nothing_is_known_yet():
    def walked(angle):
        start = STATE._replace(theta_1=angle)
        return jb.simulate(SCENE, start, duration=0.1, accuracy=1e-3, save="end").t

    with pytest.raises(jb.ArgumentError, match="under jit, vmap or differentiation"):
        jax.jit(walked)(-0.25)


def test_single_precision_ends_at_its_own_floor():
    soft = jb.seed_scene(K=1e4, c=1e4)
    start = jax.tree.map(lambda leaf: np.float32(leaf), STATE)
    with pytest.warns(RuntimeWarning, match="is not met"):
        walk = jb.simulate(soft, start, duration=0.05, accuracy=1e-9, save="end", engine="xla")
    assert walk.error.rtol >= 32 * np.finfo(np.float32).eps
    assert walk.t.dtype == np.float32

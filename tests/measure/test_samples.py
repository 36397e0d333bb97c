"""Reading between a walk's steps, against closed forms."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.dynamics._contacts import contacts
from jaxbiped.measure._samples import NODES, Samples, moments_of_change, sample

HEIGHTS = np.array([0.5, 0.45, 0.42])


@pytest.fixture(scope="module")
def fall():
    """The walker dropped upright and at rest, until before it touches."""
    scene = jb.seed_scene()
    start = jb.State(*[0.0] * 8)._replace(hip_z=0.6)
    return scene, jb.simulate(scene, start, duration=0.2, watch=())


def test_moments_of_change_are_those_of_free_fall(fall):
    scene, walk = fall
    acceleration = 9.8 * np.cos(0.02)
    lowest = HEIGHTS - (0.4 - 0.08)

    def is_below(now):
        return now.feet[0].z < lowest[:, None]

    before, after = np.zeros(3), np.full(3, 0.2)
    found = moments_of_change(scene, walk, contacts, is_below, before, after)
    np.testing.assert_allclose(found, np.sqrt(2.0 * (0.6 - HEIGHTS) / acceleration), rtol=1e-9)


def test_the_integral_of_the_speed_is_the_way(fall):
    scene, walk = fall
    speeds = sample(scene, walk, lambda _, state: state.hip_vx, np.zeros(1))
    way = 0.5 * 9.8 * np.sin(0.02) * 0.2**2
    assert speeds.integral(speeds.values).sum() == pytest.approx(way, rel=1e-9)


def test_a_batch_is_read_one_at_a_time(fall):
    _, walk = fall
    batch = jb.Trajectory(**{**vars(walk), "t": np.stack([walk.t, walk.t])})
    with pytest.raises(ValueError, match="one of them at a time"):
        batch.at(0.1)


def test_samples_lie_at_gauss_points_and_integrate_what_is_above_zero():
    edges = np.array([0.0, 0.5, 2.0])
    times = 0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * NODES
    samples = Samples(edges, None)
    np.testing.assert_allclose(samples.integral(times**9), np.diff(edges**10) / 10)
    np.testing.assert_allclose(samples.positive_integral(times - 1.0), [0.0, 0.5])
    np.testing.assert_allclose(samples.positive_integral(1.0 - times), [0.375, 0.125])


def test_roughness_is_how_much_a_rule_of_order_four_errs():
    """Its points are those at ±x₁: of a fourth power it integrates 2x₁²/3 where 2/5 is right."""
    edges = np.array([0.0, 0.5, 2.0])
    middles, halves = 0.5 * (edges[1:] + edges[:-1])[:, None], 0.5 * np.diff(edges)
    times = middles + halves[:, None] * NODES
    samples = Samples(edges, None)
    np.testing.assert_allclose(samples.roughness(times**3 - times), 0.0, atol=1e-14)
    square = (5.0 - 2.0 * np.sqrt(10.0 / 7.0)) / 9.0
    off = 2.0 / 3.0 * square - 2.0 / 5.0
    wanted = np.abs(off) * halves**5
    np.testing.assert_allclose(samples.roughness((times - middles) ** 4), wanted, rtol=1e-12)

"""The uncertainty exponent, against boundaries whose dimension is known."""

import numpy as np
import pytest

import jaxbiped as jb
from tests.basins.known_basins import (
    NEWTON_BOX,
    Recorded,
    ball,
    cantor,
    half_space,
    newton,
    on_lattice,
)

CANTOR = np.log(2.0) / np.log(3.0)
SQUARE = ((-1.0, -1.0), (1.0, 1.0))


def test_a_line_on_a_grid_in_closed_form():
    labels = np.repeat(np.arange(128) > 60, 128).reshape(128, 128).astype(int)
    found = jb.basins.uncertainty_exponent(labels)
    np.testing.assert_array_equal(found.distances, [1, 2, 4, 8, 16])
    np.testing.assert_allclose(found.fractions, 2 * found.distances / (128 - 2 * 16), rtol=1e-12)
    assert (found.exponent, found.dimension) == (pytest.approx(1.0), pytest.approx(1.0))
    assert found.error < 1e-12


def test_a_sampled_line_in_closed_form():
    """A direction at an angle φ to the normal crosses within ε |cos φ|: on average 2 ε / π."""
    distances = np.geomspace(1e-3, 0.05, 6)
    found = jb.basins.sampled_uncertainty(
        half_space((1.0, 0.0), 0.2), *SQUARE, distances=distances, samples=2**15
    )
    expected = 2.0 * distances * (2.0 / np.pi) / (1.0 - 2.0 * distances[-1])
    np.testing.assert_allclose(found.fractions, expected, rtol=0.1)
    assert found.exponent == pytest.approx(1.0, abs=0.02)
    assert found.dimension == pytest.approx(2.0 - found.exponent)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_smooth_boundaries_have_one_dimension_less(d):
    found = jb.basins.sampled_uncertainty(
        ball(np.full(d, 0.1), 0.6), [-1.0] * d, [1.0] * d,
        distances=np.geomspace(2e-3, 0.05, 6), samples=2**14,
    )  # fmt: skip
    assert found.exponent == pytest.approx(1.0, abs=0.06)
    assert found.dimension == pytest.approx(d - 1.0, abs=0.06)


def test_cantors_set_sampled_and_on_a_grid():
    sampled = jb.basins.sampled_uncertainty(
        cantor, (0.0,), (1.0,), distances=3.0 ** -np.arange(2, 11), samples=2**14
    )
    assert sampled.dimension == pytest.approx(CANTOR, abs=0.03)
    labels = on_lattice(cantor, (-0.01,), (1.013,), (20001,))
    grid = jb.basins.uncertainty_exponent(labels, distances=2 ** np.arange(11))
    assert grid.dimension == pytest.approx(CANTOR, abs=0.04)


def test_newtons_basins_agree_with_the_published_dimension():
    grid = on_lattice(newton, *NEWTON_BOX, (513, 513))
    assert jb.basins.uncertainty_exponent(grid).dimension == pytest.approx(1.42, abs=0.06)
    sampled = jb.basins.sampled_uncertainty(
        newton, *NEWTON_BOX, distances=np.geomspace(3e-4, 3e-2, 8), samples=2**13
    )
    assert sampled.dimension == pytest.approx(1.42, abs=0.1)


def test_asks_once_for_each_start_and_never_outside_the_box():
    lower, upper = np.array([-1.0, 5.0, 0.0]), np.array([1.0, 6.0, 1e-3])
    label_of = Recorded(half_space((1.0, 0.0, 0.0), 0.05))
    options = {"distances": (0.4, 0.05, 0.1), "samples": 300}
    one = jb.basins.sampled_uncertainty(label_of, lower, upper, **options)
    assert len(label_of.points) == 300 * 7
    assert len(np.unique(label_of.points, axis=0)) == 300 * 7
    assert ((label_of.points >= lower) & (label_of.points <= upper)).all()
    np.testing.assert_array_equal(one.distances, [0.05, 0.1, 0.4])
    two = jb.basins.sampled_uncertainty(label_of, lower, upper, batch=101, **options)
    np.testing.assert_array_equal(one.fractions, two.fractions)
    assert max(len(points) for points in label_of.calls[1:]) == 101


@pytest.mark.parametrize(
    ("labels", "distances", "words"),
    [
        (np.zeros((99, 99), int), None, ("labels", "0 of", "at least 3")),
        (np.eye(99, dtype=int), (1, 2, 50), ("distances", "50", "below 49.5")),
        (np.eye(99, dtype=int), (0, 1, 2), ("distances", "0", "at least 1")),
        (np.int64(3), None, ("labels", "()", "grid")),
        (np.full((9, 9), -1), None, ("labels", "81 pending")),
    ],
)
def test_bad_grids_are_named(labels, distances, words):
    with pytest.raises(jb.ArgumentError) as caught:
        jb.basins.uncertainty_exponent(labels, distances=distances)
    assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"distances": (0.01, 0.6)}, ("distances", "0.6", "below 0.5")),
        ({"distances": (0.01, -0.1)}, ("distances", "-0.1", "above 0")),
        ({"distances": ()}, ("distances", "(0,)")),
        ({"samples": 0}, ("samples", "0", "at least 1")),
        ({"upper": (0.0, 1.0)}, ("lower[0] = 0", "below")),
        ({"label_of": half_space((1.0, 0.0), 5.0)}, ("0 of 3", "at least 3")),
    ],
)
def test_bad_arguments_are_named(change, words):
    right = {"lower": (0.0, 0.0), "upper": (1.0, 1.0), "distances": (0.01, 0.02, 0.1)}
    with pytest.raises(jb.ArgumentError) as caught:
        jb.basins.sampled_uncertainty(
            **({"label_of": ball((0, 0), 0.5), "samples": 64} | right | change)
        )
    assert all(word in str(caught.value) for word in words)

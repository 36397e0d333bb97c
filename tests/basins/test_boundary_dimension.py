"""Dimensions by boxes and by uncertain starts, against boundaries whose dimension is known."""

import numpy as np
import pytest
from scipy.stats import linregress

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

SQUARE = ((-1.0, -1.0), (1.0, 1.0))


def _sierpinski(n):
    """Pascal's triangle modulo 2: its edge is Sierpinski's triangle, of dimension log2 3."""
    i = np.arange(n)
    return ((i[:, None] & i) == 0).astype(int)


def test_an_upright_line_has_dimension_one_exactly():
    labels = np.repeat(np.arange(257) > 100, 257).reshape(257, 257).astype(int)
    found = jb.basins.boundary_dimension(labels)
    assert found.estimate == pytest.approx(1.0, abs=1e-12)
    assert found.error < 1e-12
    np.testing.assert_array_equal(found.sizes, [1, 2, 4, 8, 16, 32, 64])
    np.testing.assert_array_equal(found.counts, 256 // found.sizes)


@pytest.mark.parametrize(
    ("label_of", "shape", "levels", "dimension"),
    [
        (half_space((1.0,), 0.3), (4,), 6, 0.0),
        (half_space((1.0, 0.37), 0.123), (4, 4), 7, 1.0),
        # Its right end enters a coarse cell between two corners.
        (ball((0.0, 0.25), 0.55), (4, 4), 7, 1.0),
        (ball((0.1, -0.05, 0.02), 0.62), (4, 4, 4), 4, 2.0),
    ],
)
def test_smooth_boundaries_have_one_dimension_less(label_of, shape, levels, dimension):
    d = len(shape)
    refined = jb.basins.refine_boundary(label_of, (-1.0,) * d, (1.0,) * d, shape, levels=levels)
    found = jb.basins.boundary_dimension(refined, skip=1)
    assert found.estimate == pytest.approx(dimension, abs=0.05)
    assert found.counts[0] == len(refined.cells[-1])
    counts = [n + 1 for n in refined.cells_across(levels)]
    grid = on_lattice(label_of, refined.lower, refined.upper, counts)
    same = jb.basins.boundary_dimension(grid, sides=found.sizes)
    np.testing.assert_array_equal(same.counts, found.counts)


def test_sierpinskis_triangle():
    found = jb.basins.boundary_dimension(_sierpinski(1025))
    assert found.estimate == pytest.approx(np.log2(3.0), abs=0.02)
    assert found.estimate == pytest.approx(
        jb.basins.boundary_dimension(_sierpinski(1025), skip=3).estimate, abs=0.02
    )


def test_newtons_basins_have_the_published_dimension():
    refined = jb.basins.refine_boundary(newton, *NEWTON_BOX, (8, 8), levels=7)
    assert jb.basins.boundary_dimension(refined, skip=1).estimate == pytest.approx(1.42, abs=0.03)
    grid = on_lattice(newton, *NEWTON_BOX, (513, 513))
    assert jb.basins.boundary_dimension(grid, skip=1).estimate == pytest.approx(1.42, abs=0.04)


def test_slope_and_error_are_those_of_least_squares():
    found = jb.basins.boundary_dimension(_sierpinski(300), sides=(1, 2, 3, 6, 12, 24, 48), skip=2)
    np.testing.assert_array_equal(found.sizes, [1, 2, 3, 6, 12, 24, 48])
    fit = linregress(np.log(found.sizes[:5]), np.log(found.counts[:5]))
    assert found.estimate == pytest.approx(-fit.slope)
    assert found.error == pytest.approx(fit.stderr)


def test_boxes_share_their_faces_and_the_far_ends_are_left_out():
    labels = np.zeros((14, 14), dtype=int)
    labels[3, 3] = 1
    labels[13, 13] = 1
    found = jb.basins.boundary_dimension(labels, sides=(1, 2, 3, 6))
    np.testing.assert_array_equal(found.counts, [4, 1, 4, 1])


def test_levels_set_the_sizes_of_a_refined_boundary():
    refined = jb.basins.refine_boundary(ball((0.0, 0.1), 0.5), *SQUARE, (4, 4), levels=3)
    with pytest.raises(jb.ArgumentError, match="sides"):
        jb.basins.boundary_dimension(refined, sides=(1, 2, 4))


CANTOR = np.log(2.0) / np.log(3.0)


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
def test_smooth_boundaries_are_certain_but_for_a_layer(d):
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

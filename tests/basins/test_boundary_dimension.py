"""Box-counting dimensions, against boundaries whose dimension is known."""

import numpy as np
import pytest
from scipy.stats import linregress

import jaxbiped as jb
from tests.basins.known_basins import NEWTON_BOX, ball, half_space, newton, on_lattice

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


@pytest.mark.parametrize(
    ("labels", "options", "words"),
    [
        (np.zeros((65, 65), int), {}, ("boundary", "0 of 5", "at least 3")),
        (np.eye(9, dtype=int), {}, ("2 of 2", "at least 3")),
        (np.eye(65, dtype=int), {"skip": 5}, ("0 of 0", "at least 3")),
        (np.eye(65, dtype=int), {"skip": -1}, ("skip", "-1", "at least 0")),
        (np.eye(65, dtype=int), {"sides": (1, 2, 128)}, ("sides", "128", "at most 64")),
        (np.eye(65, dtype=int), {"sides": (1, 2, 3, 4)}, ("sides", "divide the largest")),
        (np.eye(65), {}, ("labels", "float64", "whole numbers")),
        (np.zeros((0, 3), int), {}, ("labels", "(0, 3)", "at least one")),
        (np.full((65, 65), -1), {}, ("labels", "4225 pending", "labelled")),
    ],
)
def test_bad_arguments_are_named(labels, options, words):
    with pytest.raises(jb.ArgumentError) as caught:
        jb.basins.boundary_dimension(labels, **options)
    assert all(word in str(caught.value) for word in words)


def test_levels_set_the_sizes_of_a_refined_boundary():
    refined = jb.basins.refine_boundary(ball((0.0, 0.1), 0.5), *SQUARE, (4, 4), levels=3)
    with pytest.raises(jb.ArgumentError, match="sides"):
        jb.basins.boundary_dimension(refined, sides=(1, 2, 4))

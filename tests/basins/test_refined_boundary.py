"""A refined boundary against the labels of the full grid."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from tests.basins.known_basins import NEWTON_BOX, Recorded, ball, half_space, newton, on_lattice

SQUARE = ((-1.0, -1.0), (1.0, 1.0))
UNEVEN = ((-1.0, 2.0), (3.0, 2.5))


def _hook(points):
    """A disc between the corners of a coarse cell, joined to a half-plane by a narrow neck."""
    x, y = points.T
    neck = (abs(y - 0.13) < 0.03) & (x > 0.0)
    return ((x > 0.6) | neck | (np.hypot(x - 0.12, y - 0.13) < 0.1)).astype(int)


def _full(label_of, refined):
    counts = [n + 1 for n in refined.cells_across(refined.levels)]
    return on_lattice(label_of, refined.lower, refined.upper, counts)


def _mixed(labels):
    """The cells of a full grid of two dimensions whose corners disagree, as positions."""
    corners = np.stack([labels[:-1, :-1], labels[1:, :-1], labels[:-1, 1:], labels[1:, 1:]])
    return np.argwhere(corners.min(axis=0) != corners.max(axis=0))


@pytest.mark.parametrize(
    ("label_of", "box", "shape", "levels"),
    [
        (half_space((1.0, 0.37), 0.123), SQUARE, (4, 4), 6),
        (ball((0.1, -0.05), 0.62), SQUARE, (5, 3), 5),
        (half_space((1.0, 6.0), 14.3), UNEVEN, (3, 2), 5),
        (lambda points: 3 * _hook(points) + ball((-0.5, 0.0), 0.33)(points), SQUARE, (6, 6), 5),
        (ball((0.1, -0.05, 0.02), 0.62), ((-1.0,) * 3, (1.0,) * 3), (3, 3, 3), 3),
        (half_space((1.0,), 0.3), ((-1.0,), (1.0,)), (3,), 8),
    ],
)
def test_filled_labels_and_cells_equal_the_full_grid(label_of, box, shape, levels):
    refined = jb.basins.refine_boundary(label_of, *box, shape, levels=levels)
    full = _full(label_of, refined)
    assert refined.full == full.size
    assert refined.asked == len(refined.positions) < full.size
    np.testing.assert_array_equal(refined.on_grid(), full)
    np.testing.assert_array_equal(refined.labels, label_of(refined.points))
    if len(shape) == 2:
        np.testing.assert_array_equal(refined.cells[-1], _mixed(full))
        coarse = slice(None, None, 2**levels)
        found = {tuple(cell) for cell in refined.cells[0]}
        assert found == {tuple(cell) for cell in _mixed(full[coarse, coarse])}


@settings(deadline=None, max_examples=25)
@given(st.floats(0.0, 6.28, allow_subnormal=False), st.floats(-0.3, 0.3, allow_subnormal=False))
def test_any_line_through_the_middle_equals_the_full_grid(angle, offset):
    label_of = half_space((np.cos(angle), np.sin(angle)), offset)
    refined = jb.basins.refine_boundary(label_of, *SQUARE, (3, 3), levels=4)
    full = _full(label_of, refined)
    np.testing.assert_array_equal(refined.on_grid(), full)
    np.testing.assert_array_equal(refined.cells[-1], _mixed(full))


def test_asks_as_many_labels_as_a_line_is_long():
    label_of = half_space((1.0, 0.37), 0.123)
    asked = [
        jb.basins.refine_boundary(label_of, *SQUARE, (4, 4), levels=k).asked for k in range(4, 9)
    ]
    growth = np.diff(np.diff(asked))
    np.testing.assert_allclose(growth[1:] / growth[:-1], 2.0, rtol=0.1)
    # Each halving of a boundary cell adds at most 5 points, and a line meets few cells.
    assert asked[-1] < 10 * 4 * 2**8


@pytest.mark.parametrize("follow", [True, False])
def test_no_point_is_asked_twice_and_batches_change_nothing(follow):
    options = {"levels": 5, "follow": follow}
    whole, split = Recorded(newton), Recorded(newton)
    one = jb.basins.refine_boundary(whole, *NEWTON_BOX, (8, 8), **options)
    two = jb.basins.refine_boundary(split, *NEWTON_BOX, (8, 8), batch=7, **options)
    assert len(np.unique(whole.points, axis=0)) == len(whole.points) == one.asked
    assert max(map(len, split.calls)) == 7
    assert one.calls == len(whole.calls) < two.calls == len(split.calls)
    assert follow or one.calls == 6
    np.testing.assert_array_equal(one.positions, two.positions)
    np.testing.assert_array_equal(one.labels, two.labels)
    for a, b in zip(one.cells, two.cells, strict=True):
        np.testing.assert_array_equal(a, b)


def test_following_finds_a_bay_between_coarse_points():
    with_it, without = (
        jb.basins.refine_boundary(_hook, *SQUARE, (6, 6), levels=5, follow=follow)
        for follow in (True, False)
    )
    full = _full(_hook, with_it)
    assert len(with_it.cells[0]) == len(without.cells[0])
    assert (with_it.on_grid() == full).all()
    assert (without.on_grid() != full).sum() > 100


def test_what_hides_in_a_coarse_cell_is_missed():
    label_of = ball((0.25, 0.25), 0.2)
    refined = jb.basins.refine_boundary(label_of, *SQUARE, (4, 4), levels=6)
    assert refined.asked == 25
    assert not refined.on_grid().any()
    assert all(len(cells) == 0 for cells in refined.cells)
    finer = jb.basins.refine_boundary(label_of, *SQUARE, (8, 8), levels=5)
    assert (finer.on_grid() == _full(label_of, finer)).all()


def test_a_fractal_boundary_is_found_nearly_whole():
    refined = jb.basins.refine_boundary(newton, *NEWTON_BOX, (8, 8), levels=5)
    everywhere = {tuple(cell) for cell in _mixed(_full(newton, refined))}
    found = {tuple(cell) for cell in refined.cells[-1]}
    assert found <= everywhere
    assert len(found) > 0.98 * len(everywhere)


def test_cells_have_places_and_sizes():
    refined = jb.basins.refine_boundary(half_space((1.0, 0.0), 0.1), *UNEVEN, (2, 2), levels=1)
    np.testing.assert_array_equal(refined.cells[0], [[0, 0], [0, 1]])
    np.testing.assert_array_equal(refined.cell_size(0), [2.0, 0.25])
    np.testing.assert_array_equal(refined.cell_size(1), [1.0, 0.125])
    np.testing.assert_array_equal(refined.axis(0), [-1.0, 0.0, 1.0, 2.0, 3.0])
    for k in (0, 1):
        np.testing.assert_array_equal(
            refined.points[:, k], refined.axis(k)[refined.positions[:, k]]
        )
    coarse = jb.basins.refine_boundary(half_space((1.0, 0.0), 0.1), *UNEVEN, (2, 2), levels=0)
    assert (coarse.asked, coarse.full, coarse.calls) == (9, 9, 1)


def test_a_grid_too_large_to_fill_is_refused():
    refined = jb.basins.refine_boundary(half_space((1.0, 0.3), 0.1), *SQUARE, (2, 2), levels=8)
    with pytest.raises(jb.ArgumentError, match=r"263169 points.*largest = 1000"):
        refined.on_grid(largest=1000)

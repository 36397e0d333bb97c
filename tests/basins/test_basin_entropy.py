"""Basin entropy against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from tests.basins.known_basins import NEWTON_BOX, ball, newton, on_lattice


def _entropy(*parts):
    return -sum(p * np.log(p) for p in parts)


@settings(deadline=None, max_examples=30)
@given(st.integers(2, 8), st.integers(3, 9), st.data())
def test_an_upright_line_in_closed_form(box, boxes, data):
    """One column of boxes is parted, each with `part` of its rows below the line."""
    edge = data.draw(st.integers(1, box * boxes - 1))
    labels = np.zeros((box * boxes, box * boxes), dtype=int)
    labels[edge:] = 3
    found = jb.basins.entropy(labels, box=box)
    part = (edge % box) / box
    expected = _entropy(part, 1.0 - part) if part else 0.0
    assert found.basin == pytest.approx(expected / boxes, abs=1e-12)
    assert found.boundary_boxes == (boxes if part else 0)
    if part:
        assert found.boundary == pytest.approx(expected)
    else:
        assert np.isnan(found.boundary)
    assert not found.fractal


def test_lines_at_all_offsets_average_to_half_a_nat():
    """The integral of the entropy over the part p from 0 to 1 is 1/2."""
    box = 200
    rows = np.arange(box)[:, None]
    found = [jb.basins.entropy(np.tile(1 * (rows < k), box), box=box) for k in range(1, box)]
    assert np.mean([one.boundary for one in found]) == pytest.approx(0.5, abs=0.005)


def test_boxes_of_four_labels_exceed_log_two():
    labels = np.tile([[0, 1], [2, 3]], (6, 6))
    found = jb.basins.entropy(labels, box=2)
    assert found.basin == pytest.approx(np.log(4.0))
    assert found.boundary == pytest.approx(np.log(4.0))
    assert found.boundary_error == pytest.approx(0.0, abs=1e-15)
    assert (found.boxes, found.boundary_boxes, found.fractal) == (36, 36, True)


def test_boxes_of_a_cube_and_what_does_not_fill_one():
    labels = np.zeros((9, 8, 8), dtype=int)
    labels[2:4, :4, :4] = 1
    labels[8] = 5
    found = jb.basins.entropy(labels, box=4)
    assert (found.boxes, found.boundary_boxes) == (8, 1)
    assert found.boundary == pytest.approx(np.log(2.0))
    assert found.basin == pytest.approx(np.log(2.0) / 8)
    assert np.isnan(found.boundary_error)


def test_error_of_the_mean():
    labels = np.zeros((4, 12), dtype=int)
    labels[0, 0] = labels[:2, 4:8] = 1
    parts = [_entropy(1 / 16, 15 / 16), np.log(2.0)]
    found = jb.basins.entropy(labels, box=4)
    assert found.boundary == pytest.approx(np.mean(parts))
    assert found.boundary_error == pytest.approx(np.std(parts, ddof=1) / np.sqrt(2.0))


def test_newtons_basins_are_fractal_and_a_disc_is_not():
    newtons = jb.basins.entropy(on_lattice(newton, *NEWTON_BOX, (600, 600)))
    assert newtons.fractal
    assert newtons.boundary - 3 * newtons.boundary_error > np.log(2.0)
    disc = jb.basins.entropy(on_lattice(ball((0.1, 0.0), 0.6), (-1, -1), (1, 1), (600, 600)))
    assert not disc.fractal
    assert disc.boundary + 3 * disc.boundary_error < np.log(2.0)
    assert disc.basin < newtons.basin

"""Continuation of fixed points against curves in closed form."""

import numpy as np
import pytest

from jaxbiped.gait._homotopy import BranchEnd, follow_branch
from jaxbiped.gait._pseudo_arclength import Change


def branch_of(value, by_point, by_s, *, start, ends=lambda x, s: 0, scale=1.0):
    def change(point, s):
        x = float(point[0])
        return Change(
            np.array([value(x, s)]),
            np.array([[by_point(x, s)]]),
            np.array([by_s(x, s)]),
            ends(x, s),
        )

    return follow_branch(change, np.array([start]), scales=np.array([scale]))


def test_a_smooth_branch_is_followed_to_its_end():
    branch = branch_of(
        lambda x, s: x - np.exp(2 * s),
        lambda x, s: 1.0,
        lambda x, s: -2 * np.exp(2 * s),
        start=1.0,
    )
    assert branch.end is BranchEnd.REACHED
    assert branch.s[-1] == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(branch.points[:, 0], np.exp(2.0 * branch.s), atol=1e-7)


def test_a_fold_is_told_with_its_place():
    """x² = 0.6 − s from x > 0 turns back at s = 0.6."""
    branch = branch_of(
        lambda x, s: x * x - 0.6 + s, lambda x, s: 2.0 * x, lambda x, s: 1.0, start=0.6**0.5
    )
    assert branch.end is BranchEnd.FOLD
    assert branch.s[branch.farthest] == pytest.approx(0.6, abs=1e-6)
    # The branch was followed around the fold, to the other sign of x.
    assert branch.points[-1, 0] < 0.0
    np.testing.assert_allclose(branch.points[:, 0] ** 2, 0.6 - branch.s, atol=1e-7)


def test_two_folds_on_the_way_are_passed():
    """A cubic in x: an S-shaped branch reaches s = 1 beyond both of its folds."""

    def s_of(x):
        return 8.0 * ((x - 0.5) ** 3 - 0.06 * (x - 0.5)) + 0.5

    def slope(x):
        return 8.0 * (3.0 * (x - 0.5) ** 2 - 0.06)

    start = float(np.roots([8.0, 0.0, -0.48, 0.5]).real.min()) + 0.5
    assert s_of(start) == pytest.approx(0.0, abs=1e-9)
    branch = branch_of(
        lambda x, s: s_of(x) - s, lambda x, s: slope(x), lambda x, s: -1.0, start=start, scale=0.2
    )
    assert branch.end is BranchEnd.REACHED
    assert np.sum(np.diff(np.sign(np.diff(branch.s))) != 0) == 2
    assert s_of(branch.points[-1, 0]) == pytest.approx(1.0, abs=1e-3)


def test_where_a_walk_ends_the_branch_ends():
    branch = branch_of(
        lambda x, s: x - s,
        lambda x, s: 1.0,
        lambda x, s: -1.0,
        start=0.0,
        ends=lambda x, s: 3 if s > 0.4 else 0,
    )
    assert branch.end is BranchEnd.WALK_ENDS
    assert branch.code == 3
    assert branch.s[branch.farthest] == pytest.approx(0.4, abs=1e-3)


def test_a_jump_of_the_map_breaks_it_off():
    branch = branch_of(
        lambda x, s: x - s - 50.0 * (s > 0.3),
        lambda x, s: 1.0,
        lambda x, s: -1.0,
        start=0.0,
    )
    assert branch.end is BranchEnd.BREAKS_OFF
    assert branch.s[branch.farthest] == pytest.approx(0.3, abs=1e-3)


def test_no_beginning():
    branch = branch_of(
        lambda x, s: x, lambda x, s: 1.0, lambda x, s: 0.0, start=0.0, ends=lambda x, s: 2
    )
    assert branch.end is BranchEnd.NO_BEGINNING

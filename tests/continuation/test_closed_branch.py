"""A closed branch and its folds, against the circle on which its fixed points lie."""

import dataclasses
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.continuation import BranchEvent, bifurcation_curve, resume_branch
from jaxbiped.gait import BranchEnd


class Mark(NamedTuple):
    """A mark on a disc, and the disc's turn."""

    height: Any
    turn: Any

    periodic = MappingProxyType({"turn": 1.0})


class Engraver(jb.hybrid.HybridSystem):
    """Twice a turn the mark x moves by (x² + (p − 1/2)² − R²)/10; it stays where this is zero."""

    state_type = Mark
    place: float = jb.laws.parameter("place", "$p$", default=0.45)
    radius: float = jb.laws.parameter("radius", "$R$", default=0.25)

    def rates(self, y):
        return Mark(0.0, 1.0)

    def guards(self):
        def engrave(y):
            square = y.height**2 + (self.place - 0.5) ** 2
            return y._replace(height=y.height + 0.1 * (square - self.radius**2))

        return (jb.hybrid.Guard("half", lambda y: 0.5 - y.turn, reset=engrave),)


@pytest.fixture(scope="module")
def circle():
    start = Mark(-np.sqrt(0.06), 0.5)
    return jb.continue_gait(Engraver(), "place", bounds=(0.0, 1.0), guess=start)


@pytest.mark.parametrize("step", [0.03, 0.1])
@pytest.mark.parametrize(("at", "direction"), [(1, "forward"), (0, "backward")])
def test_a_closed_branch_that_is_resumed_ends_where_it_began(circle, at, direction, step):
    """From either of two gaits around to the other; steps are shorter or longer than between them.

    It turns once, so that no gait but the first, which closes it, is there twice.
    """
    two = resume_branch(circle, 0, largest_step=0.16, max_points=1)
    assert len(two) == 2
    branch = resume_branch(two, at, direction=direction, largest_step=step)
    assert branch.stops[-1 if direction == "forward" else 0].end is BranchEnd.CLOSED
    heights = np.array([point.recurring[0] for point in branch.points])
    across = branch.values - 0.5
    np.testing.assert_allclose(np.hypot(heights, across), 0.25, rtol=1e-9)
    turned = np.unwrap(np.arctan2(heights, across))
    assert np.all(np.diff(turned) > 0.0)
    assert turned[-1] - turned[0] == pytest.approx(2.0 * np.pi, abs=1e-9)


def test_a_fold_is_corrected_from_afar(circle):
    """The circle has shrunk to a 25th: Newton's method halves the distance to it step by step."""
    (fold,) = [point for point in circle.bifurcations if point.value > 0.5]
    assert (fold.kind, fold.value) == (BranchEvent.FOLD, pytest.approx(0.75, abs=1e-9))
    small = dataclasses.replace(circle, scene=Engraver(radius=0.01))
    curve = bifurcation_curve(small, fold, "radius", bounds=(0.005, 0.02), max_points=4)
    place, radius = curve.values.T
    np.testing.assert_allclose(place, 0.5 + radius, rtol=0.0, atol=1e-10)
    assert np.min(radius) < 0.01 < np.max(radius)

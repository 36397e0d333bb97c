"""Pareto fronts: what is known of their points and drawn of them, against points by hand."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.optimise import Curvature, Outcome, ParetoFront
from tests.plot.test_fit_charts import _optimum

SPEED = jb.optimise.OBJECTIVES["speed"].quantity
BOUNDS = np.array([0.19, 0.2, 0.21, 0.22])


def make_front(objectives=(0.40, 0.41, 0.42, 0.43), curvatures=(1.0, 1.0, 0.01, 1.0)):
    """Speeds under upper bounds of step length; the last but one has no sure curvature."""
    optima = [
        dataclasses.replace(
            _optimum(bound=bound), objective=speed, curvature=Curvature(np.array([bend]), 0.1)
        )
        for bound, speed, bend in zip(BOUNDS, objectives, curvatures, strict=True)
    ]
    return ParetoFront(BOUNDS, tuple(optima), "step_length", True, -1.0, SPEED)


def unheld(front, place):
    """The front whose bound does not hold one of its points."""
    optimum = front.optima[place]
    (held,) = optimum.optimality.requirements
    free = held._replace(active=False, multiplier=0.0)
    known = optimum.optimality._replace(requirements=(free,))
    optima = list(front.optima)
    optima[place] = dataclasses.replace(optimum, optimality=known)
    return front._replace(optima=tuple(optima))


def test_points_without_a_proof_and_those_that_others_dominate_are_named():
    front = make_front((0.40, 0.41, 0.405, 0.43))
    np.testing.assert_allclose(front.slopes, [[0.3] * 4, [0.0] * 4])
    assert front.proven.tolist() == [True, True, False, True]
    # The bar of a speed is 1e-3; 0.405 at 0.21 m is slower than 0.41 at 0.20 m.
    assert front.dominated.tolist() == [False, False, True, False]
    assert make_front((0.40, 0.41, 0.409, 0.43)).dominated.tolist() == [False] * 4
    lower = front._replace(upper=False, sense=1.0)
    assert lower.dominated.tolist() == [False, True, False, False]
    assert unheld(front, 1).holds.tolist() == [True, False, True, True]
    optima = [dataclasses.replace(each, outcome=Outcome.CORNER) for each in front.optima]
    assert not np.any(front._replace(optima=tuple(optima)).proven)


def test_a_front_has_marks_bars_and_tangents():
    front = unheld(make_front(), 1)
    (ax,) = plot.pareto_front(front).axes
    assert [ax.get_xlabel(), ax.get_ylabel()] == ["$L$ (m)", "$v$ (m/s)"]
    tangents = [line.get_xydata() for line in ax.lines if line.get_marker() in ("None", "")]
    tangents = [points for points in tangents if len(points) == 2]
    slopes = [np.diff(points[:, 1])[0] / np.diff(points[:, 0])[0] for points in tangents]
    np.testing.assert_allclose(slopes, [0.3] * 3)
    np.testing.assert_allclose([points[:, 0].mean() for points in tangents], BOUNDS[[0, 2, 3]])
    filled, opened = (line for line in ax.lines if line.get_marker() == "o")
    np.testing.assert_allclose(filled.get_xdata(), BOUNDS[[0, 1, 3]])
    np.testing.assert_allclose(opened.get_xdata(), BOUNDS[[2]])
    with pytest.raises(jb.ArgumentError, match="front"):
        plot.pareto_front(front.bounds)

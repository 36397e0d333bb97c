"""Figures of branches, against branches made by hand: nothing is compiled."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.continuation import (
    Axis,
    BifurcationCurve,
    BifurcationPoint,
    Branch,
    BranchEvent,
    BranchPoint,
    BranchStop,
    DoublingCascade,
)
from jaxbiped.plot import bifurcation_curves, branch
from tests.drawn import assert_is_drawn, legend_of, points_of

STOP = BranchStop(jb.gait.BranchEnd.REACHED, "the range ends", 0.0)


def branch_point(value, leading, error=1e-9, length=None):
    return BranchPoint(
        value=value,
        recurring=np.array([0.1, 0.2, -1.0, value]),
        period=0.4,
        step_length=value if length is None else length,
        peak_normal=20.0,
        multipliers=np.array([leading, 0.1, 0.0], complex),
        multiplier_errors=np.array([error, 0.0, 0.0]),
        unit_multiplier_error=1e-9,
        bifurcation=0,
        residual=1e-12,
        place=np.zeros(5),
        tangent=np.eye(5)[-1],
    )


def make_branch(points, events=(), footsteps=1, name="slope", log=False):
    return Branch(
        scene=jb.ladder()["rigid"],
        points=tuple(points),
        bifurcations=tuple(events),
        stops=(STOP, STOP),
        axis=Axis(name, 0.01, 0.1, log, 0),
        state_type=jb.dynamics.RigidState,
        footsteps=footsteps,
        accuracy="balanced",
        engine="lanes",
    )


LEADING = {0.02: 0.5, 0.04: -0.9, 0.05: -1.0, 0.06: -1.1, 0.07: -1.2}
POINTS = [branch_point(value, leading) for value, leading in LEADING.items()]
POINTS += [branch_point(0.08, -1.2, error=0.5), branch_point(0.09, -1.1, error=0.5)]
DOUBLING = BifurcationPoint(BranchEvent.PERIOD_DOUBLING, POINTS[2], -1.0 + 0j, 1e-9)


def test_stability_is_told_by_the_kind_of_line():
    figure = branch(make_branch(POINTS, [DOUBLING]))
    assert_is_drawn(figure)
    (ax,) = figure.axes
    stable, unstable, undecided, mark = ax.lines
    assert [line.get_linestyle() for line in (stable, unstable, undecided)] == ["-", "--", "--"]
    assert unstable._dash_pattern != undecided._dash_pattern
    lines = points_of(ax)
    assert lines[0][:, 0].tolist() == [0.02, 0.04, 0.05]
    assert lines[1][:, 0].tolist() == [0.05, 0.06, 0.07, 0.08]
    assert lines[2][:, 0].tolist() == [0.08, 0.09]
    assert mark.get_marker() == "D"
    assert legend_of(ax) == ["stable", "unstable", "undecided", "period doubling"]
    assert ax.get_xlabel() == r"slope, $\alpha$ (rad)"
    assert ax.get_ylabel() == "step length, $L$ (m)"


def _doubled(bifurcations=()):
    """Two footsteps that part at the doubling of `POINTS`, and their bifurcations."""
    points = []
    for value, apart in ((0.06, 0.01), (0.07, 0.02)):
        lengths = np.array([value + apart, value - apart])
        states = np.stack([POINTS[0].recurring, POINTS[0].recurring + 1.0])
        steps = SimpleNamespace(
            recurring=states, period=np.array([0.5, 0.3]), step_length=lengths,
            peak_normal=np.array([20.0, 30.0]),
        )  # fmt: skip
        point = branch_point(value, 0.9, length=lengths.sum())
        points.append(point._replace(footsteps=steps, period=0.8))
    events = [BifurcationPoint(kind, points[-1], -1.0 + 0j, 1e-9) for kind in bifurcations]
    begins = BranchStop(jb.gait.BranchEnd.BRANCHES_OFF, "a branch doubles", DOUBLING.value)
    two = make_branch(points, events, footsteps=2)
    return dataclasses.replace(two, stops=(begins, STOP))


def test_every_footstep_of_a_doubled_cycle_is_drawn_from_the_doubling_on():
    one, two = make_branch(POINTS, [DOUBLING]), _doubled([BranchEvent.PERIOD_DOUBLING])
    cascade = DoublingCascade((one, two), (DOUBLING,), np.array([0.05]), np.zeros(0))
    (ax,) = branch(cascade).axes
    *_, upper, lower = (line for line in ax.lines if len(line.get_xdata()) > 1)
    np.testing.assert_allclose(upper.get_xydata(), [[0.05, 0.05], [0.06, 0.07], [0.07, 0.09]])
    np.testing.assert_allclose(lower.get_xydata(), [[0.05, 0.05], [0.06, 0.05], [0.07, 0.05]])
    assert upper.get_linestyle() == lower.get_linestyle() == "-"
    assert {"1 footstep", "2 footsteps"} <= set(legend_of(ax))
    marks = [tuple(line.get_xydata()[0]) for line in ax.lines if line.get_marker() == "D"]
    np.testing.assert_allclose(sorted(marks), [(0.05, 0.05), (0.07, 0.05), (0.07, 0.09)])
    assert len(branch(cascade.branches).axes[0].lines) == len(ax.lines)
    heights = {"period": (0.5, 0.3), "speed": (0.14, 1 / 6), "peak_normal": (20, 30),
               "omega_1": (-1, 0), "spectral_radius": (0.9,)}  # fmt: skip
    for name, values in heights.items():
        (ax,) = branch(two, name).axes  # without its parent: from its first point
        lines = [line for line in ax.lines if len(line.get_xdata()) > 1][: len(values)]
        assert [line.get_ydata()[0] for line in lines] == pytest.approx(list(values)), name


def test_curves_of_bifurcations():
    values = np.array([[0.1, 1e5], [0.11, 1e6], [0.12, 1e7]])
    curve = BifurcationCurve(
        BranchEvent.FOLD, ("slope", "K"), ("rad", "N/m^1.5"), values, (), np.ones(3), np.zeros(3),
        (STOP, STOP),
    )  # fmt: skip
    figure = bifurcation_curves([curve])
    assert_is_drawn(figure)
    (ax,) = figure.axes
    assert ax.get_xscale() == "log"
    assert points_of(ax, "fold")[0].tolist() == values[:, ::-1].tolist()
    with pytest.raises(jb.ArgumentError, match="same two parameters"):
        bifurcation_curves([curve, curve._replace(along=("slope", "c"))])


@pytest.mark.parametrize(("ends", "scale"), [((2.0, 19.0), "linear"), ((2.0, 21.0), "log"),
                                             ((-1.0, 21.0), "linear")])  # fmt: skip
def test_a_range_of_more_than_a_decade_above_zero_is_logarithmic(ends, scale):
    values = np.stack([[0.1, 0.2], ends], axis=1)
    curve = BifurcationCurve(
        BranchEvent.FOLD, ("slope", "K"), ("rad", "N/m"), values, (), np.ones(2), np.zeros(2),
        (STOP, STOP),
    )  # fmt: skip
    assert bifurcation_curves([curve]).axes[0].get_xscale() == scale


def test_what_cannot_be_drawn():
    with pytest.raises(jb.ArgumentError, match="must have a point"):
        branch(make_branch([]))
    with pytest.raises(jb.ArgumentError, match="one parameter"):
        branch([make_branch(POINTS), make_branch(POINTS, name="m")])
    with pytest.raises(jb.ArgumentError, match="measure = 'hip_z' is not known"):
        branch(make_branch(POINTS), "hip_z")


def test_measures_are_of_a_footstep_and_have_their_units():
    """Here on a logarithmic axis."""
    found = make_branch([branch_point(0.02, 0.5, length=0.3)], footsteps=2, name="m", log=True)
    measures = {"speed": 0.3 / 0.4, "period": 0.2, "step_length": 0.15, "peak_normal": 20.0,
                "spectral_radius": 0.5, "omega_1": -1.0}  # fmt: skip
    for name, value in measures.items():
        figure = branch(found, name)
        assert_is_drawn(figure)
        assert figure.axes[0].get_xscale() == "log"
        assert points_of(figure.axes[0])[0] == pytest.approx(np.array([[0.02, value]])), name


def test_the_radius_has_its_errors_and_the_line_of_one():
    points = [branch_point(0.02 * k, 0.3 * k, error=0.01 * k) for k in (1, 2, 3)]
    (ax,) = branch(make_branch(points), "spectral_radius").axes
    (band,) = ax.collections
    corners = band.get_paths()[0].vertices
    for k in (1, 2, 3):
        heights = corners[np.isclose(corners[:, 0], 0.02 * k), 1]
        assert (heights.min(), heights.max()) == pytest.approx((0.29 * k, 0.31 * k))
    (line,) = (each for each in ax.lines if each.get_label() == "radius 1")
    assert set(line.get_ydata()) == {1.0}
    assert ax.get_ylim()[1] > 1.0
    assert "radius 1" in legend_of(ax)
    # An error that is not known, where the gait grazes, has no band.
    grazing = branch(
        make_branch([branch_point(0.02, 0.3, error=np.inf), *points]), "spectral_radius"
    )
    assert np.isfinite(grazing.axes[0].get_ylim()).all()

"""Figures of work against precision and of constraint methods, against rows made by hand."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped.plot import constraint_runs
from tests.drawn import assert_is_drawn, legend_of, points_of


def _row(way, error, cpu_s, outcome="ok"):
    errors = {} if error is None else {"state": error}
    return dict(way=way, setting="x", outcome=outcome, errors=errors, cpu_s=cpu_s, attempted=3)


ROWS = [
    _row("ours", 1e-3, 0.1),
    _row("ours", 1e-6, 0.3),
    _row("peer", 1e-4, 1.0),
    _row("peer", 0.4, 0.5, outcome="wrong"),
    _row("absent", None, None, outcome="not installed"),
]


def test_ways_are_lines_and_failures_a_band():
    figure = jb.plot.work_precision(ROWS, "state", floor=1e-7)
    assert_is_drawn(figure)
    (ax,) = figure.axes
    np.testing.assert_allclose(points_of(ax, "ours")[0], [[1e-3, 0.1], [1e-6, 0.3]])
    np.testing.assert_allclose(points_of(ax, "peer")[0], [[1e-4, 1.0]])
    crosses = [line for line in ax.lines if line.get_marker() == "x"]
    assert len(crosses) == 2
    best = max(x for way in ("ours", "peer") for x, _ in points_of(ax, way)[0])
    assert all(best < line.get_xdata()[0] < ax.get_xlim()[1] for line in crosses)
    assert crosses[0].get_ydata()[0] == 0.5
    shaded = ax.patches[0]  # no error is known below the floor
    assert shaded.get_x() + shaded.get_width() == pytest.approx(1e-7)
    assert [text.get_text() for text in ax.texts] == ["failed"]
    (floor,) = [line for line in ax.lines if "disagreement" in line.get_label()]
    assert list(floor.get_xdata()) == [1e-7, 1e-7]
    assert ax.get_xlim()[0] < 1e-7
    assert "the references' disagreement" in legend_of(ax)


def test_steps_in_place_of_time():
    figure = jb.plot.work_precision(ROWS, "state", cost="attempted")
    assert figure.axes[0].get_ylabel() == "attempted steps (–)"


@pytest.mark.parametrize(
    ("axis", "cost", "said"), [("period", "cpu_s", "'period'"), ("state", "money", "'money'")]
)
def test_what_cannot_be_drawn_is_refused(axis, cost, said):
    with pytest.raises(jb.ArgumentError, match=said):
        jb.plot.work_precision(ROWS, axis, cost=cost)


def _run(method="standard", integrator="rodas4", by=1e-6, **changes):
    known = dict(
        method=method,
        integrator=integrator,
        rtol=None if integrator == "euler" else by,
        dt_s=by if integrator == "euler" else None,
        ending="walking",
        max_violation_m=1e-9,
        max_violation_rate=1e-8,
        state_error=1e-7,
        wall_s_run=0.01,
        steps=80,
    )
    return known | changes


def _marks(ax, label):
    return next(line for line in ax.lines if line.get_label() == label).get_xydata()


def test_a_row_for_each_method_and_a_mark_for_each_integrator():
    runs = [
        _run(),
        _run("index1", max_violation_m=0.0, state_error=2e-7),
        _run(integrator="euler", by=1e-5, wall_s_run=0.02),
        _run("index1", "euler", 1e-5, ending="failed", state_error=None),
    ]
    figure = constraint_runs(runs)
    assert isinstance(figure, Figure)
    violation, error, time = figure.axes
    assert [label.get_text() for label in violation.get_yticklabels()] == ["standard", "index1"]
    first = _marks(violation, "rodas4, tolerance 1e-06")
    assert first[:, 0].tolist() == [1e-9, 1e-17]
    assert first[:, 1].round().tolist() == [0.0, 1.0]
    assert _marks(error, "euler, steps of 1e-05 s")[:, 0].tolist() == [1e-7]
    assert _marks(time, "euler, steps of 1e-05 s")[:, 0].tolist() == [0.02, 0.01]
    crosses = [line for line in violation.lines if line.get_marker() == "x"]
    assert [len(line.get_xdata()) for line in crosses] == [0, 1, 0]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()][-1] == "failed"
    for ax, unit in zip(figure.axes, ("(m)", "(SI units)", "(s)"), strict=True):
        assert unit in ax.get_xlabel()
    assert_is_drawn(figure, unitless={"method"})


def test_no_runs_are_refused():
    with pytest.raises(jb.ArgumentError, match="runs is empty"):
        constraint_runs([])

"""The picture of constraint methods, against runs made by hand."""

import pytest
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped.plot import constraint_runs
from tests.drawn import assert_is_drawn


def _run(method="standard", integrator="rodas4", by=1e-6, **changes):
    known = dict(
        method=method,
        integrator=integrator,
        rtol_or_dt=by,
        fixed=integrator == "euler",
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

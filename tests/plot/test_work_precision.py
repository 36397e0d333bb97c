"""Figure of work against precision."""

import numpy as np
import pytest

import jaxbiped as jb
from tests.drawn import assert_is_drawn, points_of


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


def test_steps_in_place_of_time():
    figure = jb.plot.work_precision(ROWS, "state", cost="attempted")
    assert figure.axes[0].get_ylabel() == "attempted steps (–)"


@pytest.mark.parametrize(
    ("axis", "cost", "said"), [("period", "cpu_s", "'period'"), ("state", "money", "'money'")]
)
def test_what_cannot_be_drawn_is_refused(axis, cost, said):
    with pytest.raises(jb.ArgumentError, match=said):
        jb.plot.work_precision(ROWS, axis, cost=cost)

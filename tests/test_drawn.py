"""The tests' own look at figures, against figures with one thing wrong."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.drawn import assert_is_drawn, labels_of, points_of


def _plotted(x, y, **labels):
    figure = Figure()
    ax = figure.subplots()
    ax.plot(x, y)
    ax.set(**{"xlabel": "time (s)", "ylabel": "force (N)"} | labels)
    return figure


def test_a_plot_with_units_is_drawn():
    figure = _plotted([0.0, 1.0], [2.0, 3.0])
    assert_is_drawn(figure)
    assert labels_of(figure) == {"time (s)", "force (N)"}
    np.testing.assert_array_equal(points_of(figure.axes[0])[0], [[0.0, 2.0], [1.0, 3.0]])


@pytest.mark.parametrize(
    "figure",
    [
        Figure(),
        _plotted([], []),
        _plotted([0.0, 1.0], [np.nan, np.nan]),
        _plotted([0.0, 1.0], [2.0, 3.0], ylim=(10.0, 20.0)),
        _plotted([0.0, 1.0], [2.0, 3.0], xlabel="time"),
        _plotted([0.0, 1.0], [2.0, 3.0], xlabel="", ylabel=""),
    ],
    ids=["no axes", "no data", "no numbers", "out of sight", "no unit", "no labels"],
)
def test_what_shows_nothing_is_refused(figure):
    with pytest.raises(AssertionError):
        assert_is_drawn(figure)

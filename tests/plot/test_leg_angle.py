"""The figure of leg angles over time, against the walk's angles."""

import numpy as np

from jaxbiped.plot import leg_angles


def test_angles_at_the_solvers_steps(seed_walk):
    _, walk = seed_walk
    figure = leg_angles(*seed_walk)
    steps = np.asarray(walk.t)[1:-1]
    lines = figure.axes[0].lines
    for line, angle in zip(lines, (walk.state.theta_1, walk.state.theta_2), strict=True):
        t, drawn = line.get_data()
        np.testing.assert_array_equal(drawn[np.searchsorted(t, steps)], np.asarray(angle)[1:-1])
        assert (t[0], t[-1]) == (0.0, 2.0)
    assert "(s)" in figure.axes[0].get_xlabel()
    assert "(rad)" in figure.axes[0].get_ylabel()
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == [
        "leg 1",
        "leg 2",
    ]

"""Charts of fits and of optimisations, against results made by hand: nothing is compiled."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.optimise import Evaluation, Held, Iteration, Optimality, Sensitivities
from tests.drawn import assert_is_drawn, assert_ticks_apart, points_of
from tests.plot.test_figure_style import assert_fits
from tests.plot.test_parameter_charts import branch_point, make_branch


def _fit(**changes):
    known = {
        "ending": jb.identify.FitEnding.CONVERGED,
        "estimates": {"K": 6e4, "J": 0.01, "d": 0.1},
        "standard_errors": {"K": 6e2, "J": 2e-4, "d": np.nan},
        "intervals": {"K": (5.88e4, 6.18e4), "J": (9.5e-3, 1.05e-2), "d": (np.nan, np.nan)},
        "correlation": np.eye(3),
        "undetermined": ("d",),
        "at_bounds": (),
        "residuals": np.array([0.5, -1.0, 2.0, 0.0]),
        "freedom": 2,
        "evaluations": 9,
        "units": {"K": "N/m", "J": "kg m^2", "d": "m"},
    }
    return jb.identify.GaitFit(**known | changes)


def _bars(ax, label):
    (bars,) = (each for each in ax.collections if each.get_label() == label)
    return [each[:, 0] for each in bars.get_segments() if len(each)]


def test_intervals_are_parts_of_the_estimates_in_percent():
    figure = plot.fit(_fit())
    upper, lower = figure.axes
    np.testing.assert_allclose(_bars(upper, "95 % interval"), [[-2.0, 3.0], [-5.0, 5.0]])
    np.testing.assert_allclose(_bars(upper, "standard error"), [[-1.0, 1.0], [-2.0, 2.0]])
    assert "%" in upper.get_xlabel()
    texts = [text.get_text() for text in upper.texts]
    assert texts[1].startswith("0.01000 ± 0.00020 kg m²")
    assert "6000" in texts[0]
    assert "undetermined" in texts[2]
    assert "±" not in texts[2]
    np.testing.assert_array_equal(
        points_of(lower)[-1], [[1, 0.5], [2, -1.0], [3, 2.0], [4, 0.0]]
    )  # fmt: skip
    assert "5.25" in lower.get_title(loc="left")
    assert_is_drawn(figure)


def test_measured_gaits_lie_beside_the_model_of_the_fit():
    points = [branch_point(0.02 * k, 0.5 - k, length=0.1 * k) for k in (1, 2, 3)]  # 3 is unstable
    branch = make_branch(points)
    seen = [
        jb.identify.MeasuredGait(
            {"step_length": (0.1 + 5.0 * (slope - 0.02), 0.01)}
            | ({"period": (0.41, 0.02)} if slope > 0.03 else {}),
            conditions={"slope": slope},
        )
        for slope in (0.02, 0.04)
    ]
    own = jb.parameter_values(branch.scene)
    fitted = _fit(estimates={"J": float(own["J"])})
    for columns in (0, 1, 2):
        with plot.figure_style("paper" if columns else "screen", columns=columns or 1):
            figure = plot.fit_data(fitted, seen, branch)
        assert_is_drawn(figure)
        assert_fits(figure)
        assert_ticks_apart(figure)
    period, length = figure.axes
    assert [ax.get_ylabel() for ax in figure.axes] == ["period, $T$ (s)", "step length, $L$ (m)"]
    assert "slope" in length.get_xlabel()
    np.testing.assert_allclose(points_of(length)[0], [[0.02, 0.1], [0.04, 0.2], [0.06, 0.3]])
    stable = points_of(length, "model")[0]
    assert np.isfinite(stable[:, 1]).tolist() == [True, False, False]
    for ax, rows in (
        (length, [(0.02, 0.1, 0.01), (0.04, 0.2, 0.01)]),
        (period, [(0.04, 0.41, 0.02)]),
    ):
        line, _, (bars,) = ax.containers[0].lines
        np.testing.assert_allclose(line.get_xydata(), [row[:2] for row in rows])
        ends = [segment[:, 1] for segment in bars.get_segments()]
        np.testing.assert_allclose(ends, [(y - bar, y + bar) for _, y, bar in rows])


def test_only_the_fitted_walkers_branch_is_drawn_beside_its_data():
    branch = make_branch([branch_point(0.02, 0.5)])
    own = float(jb.parameter_values(branch.scene)["J"])
    seen = jb.identify.MeasuredGait({"period": (0.4, 0.01)}, conditions={"slope": 0.02})
    angles = jb.identify.MeasuredAngles([0.0, 0.1], 0.01, theta_1=[0.1, 0.2])
    for fitted, measured, words in (
        ({"J": 1.1 * own}, seen, r"branch is not allowed: its J is 0\.0096"),
        ({"J": own}, dataclasses.replace(seen, conditions={"K": 1e5}), "its K is None"),
        ({"J": own}, dataclasses.replace(seen, footsteps=2), "its cycles have 1 footsteps"),
        ({"J": own}, jb.identify.MeasuredGait({}, angles=angles), "at least one measure"),
    ):
        with pytest.raises(jb.ArgumentError, match=words):
            plot.fit_data(_fit(estimates=fitted), measured, branch)


def test_parameters_of_two_bodies_have_two_labels_and_their_own_units():
    names = {"torso.mass": "kg", "K": "N/m^1.5", "shank.stop.K": "N m/rad"}
    known = dict(
        estimates=dict.fromkeys(names, 2.0),
        standard_errors=dict.fromkeys(names, 0.1),
        intervals=dict.fromkeys(names, (1.8, 2.2)),
        undetermined=(),
        units=names,
    )
    with plot.figure_style("paper"):
        upper = plot.fit(_fit(**known)).axes[0]
    labels = [text.get_text() for text in upper.get_yticklabels()]
    assert len(set(labels)) == 3
    assert "shank.stop" in labels[2]
    assert "N m/rad" in upper.texts[2].get_text()


def _optimum(history=5, excess=(0.1, 0.0, 0.0, 0.0, 0.0), bound=0.19, scene=None):
    speeds, lengths = np.linspace(0.4, 0.44, history), np.linspace(0.2, bound, history)
    iterates = [
        Iteration({"d": 0.1 + 0.005 * k}, speeds[k], excess[k],
                  {"speed": speeds[k], "step_length": lengths[k]})
        for k in range(history)
    ]  # fmt: skip
    none, last = {}, {"speed": 0.44, "step_length": bound}
    errors = {"speed": 1e-3, "step_length": 1e-4}
    held = Held("step_length", bound, bound, 0.0, True, 0.3, 0.0)
    free = Held("d", 0.3, 0.12, 0.0, False, 0.0, 0.0)

    def two(one, other):
        return np.array([one, other]), np.array([1e-3 * one, 1e-5])

    return jb.optimise.Optimum(
        outcome=jb.optimise.Outcome.CONVERGED,
        message="",
        scene=jb.ladder()["rigid"] if scene is None else scene,
        gait=None,
        variables={"d": 0.1 + 0.005 * (history - 1)},
        objective=0.44,
        error=1e-3,
        known=Evaluation(last, errors, none, none, np.zeros(0), np.zeros(0)),
        quantities={name: jb.optimise.OBJECTIVES[name].quantity for name in last},
        optimality=Optimality(0.0, 0.0, 0.0, (held,), (free,)),
        curvature=None,
        sensitivities=Sensitivities(
            ("slope", "bound of step_length"),
            *two(6.9, 0.3),
            {"d": np.array([0.15, -0.2])},
            {"d": np.array([1e-4, 1e-6])},
            *(dict.fromkeys(last, row) for row in two(0.1, 1.0)),
        ),
        history=iterates,
        evaluations=history,
        lost=0,
        problem=None,
        formulation="together",
        unmeasured=0,
    )


def test_each_quantity_of_an_optimisation_has_a_panel_with_its_own_unit():
    figure = plot.optimisation(_optimum())
    speed, length, variable = figure.axes
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert labels == ["$v$ (m/s)", "$L$ (m)", "$d$ (m)"]
    np.testing.assert_allclose(points_of(speed)[0][:, 1], np.linspace(0.4, 0.44, 5))
    np.testing.assert_allclose(points_of(length)[0][:, 1], np.linspace(0.2, 0.19, 5))
    np.testing.assert_allclose(points_of(variable)[0][:, 1], 0.1 + 0.005 * np.arange(5))
    bar = speed.containers[0].lines[2][0].get_segments()[0]
    np.testing.assert_allclose(bar, [[4.0, 0.439], [4.0, 0.441]])
    # The active requirement alone is drawn as a bound; the iterate that misses it is open.
    assert [line.get_ydata()[0] for line in length.lines if len(line.get_xdata()) == 2
            and line.get_xdata()[1] == 1] == [0.19]  # fmt: skip
    closed, opened = (
        line for line in speed.lines if line.get_marker() == "o" and len(line.get_xdata())
    )
    assert closed.get_xdata().tolist() == [1, 2, 3, 4]
    assert opened.get_xdata().tolist() == [0]
    assert opened.get_markerfacecolor() == "white"
    assert_is_drawn(figure)


def test_an_objective_of_several_measures_has_no_unit_of_theirs():
    found = _optimum()
    sums = [each._replace(objective=2.0) for each in found.history]
    figure = plot.optimisation(dataclasses.replace(found, history=sums))
    assert figure.axes[0].get_ylabel() == "objective (SI)"
    assert [ax.get_ylabel() for ax in figure.axes[1:4]] == ["$v$ (m/s)", "$L$ (m)", "$d$ (m)"]


def test_without_an_iterate_nothing_is_drawn():
    with pytest.raises(jb.ArgumentError, match="no history"):
        plot.optimisation(dataclasses.replace(_optimum(), history=[]))


@pytest.mark.parametrize("columns", [1, 2])
def test_nothing_is_cut_off_in_a_paper(columns):
    with plot.figure_style("paper", columns=columns):
        figures = [plot.fit(_fit()), plot.optimisation(_optimum())]
    for figure in figures:
        assert_fits(figure)
        page, renderer = figure.bbox, figure.canvas.get_renderer()
        for legend in figure.legends:
            box = legend.get_window_extent(renderer)
            assert box.x0 >= page.x0
            assert box.x1 <= page.x1

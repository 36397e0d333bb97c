"""Requirements and sums of a design, against the bounds and weights that were given."""

from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import ArgumentError
from jaxbiped.optimise._cycle_functionals import Functional, weighted_sum
from jaxbiped.optimise._design_functions import Row, conditions, radius_of, rows_of
from jaxbiped.optimise._design_problem import Design, start_of, variables_of
from jaxbiped.optimise._optimality import (
    _at_bounds,
    _explains,
    is_flat,
    is_near,
    is_untried,
    smooth_weights,
)
from jaxbiped.optimise._requirements import Requirement, larger_is_worse, requirements_of
from tests.optimise.drawn_designs import BOTH, FASTEST, SCENE, formula_problem

WORDS = {
    "spectral_radius<0.4": (None, 0.4),
    "spectral_radius <= 0.4": (None, 0.4),
    " step_length>20cm ": (0.2, None),
    "step_length>=0.2": (0.2, None),
    "period=0.5": (0.5, 0.5),
    "period==500ms": (0.5, 0.5),
}


@pytest.mark.parametrize("words", WORDS)
def test_a_requirement_in_words_is_its_bounds(words):
    (found,) = requirements_of(SCENE, words).each
    assert found == (words.strip().split("<")[0].split(">")[0].split("=")[0].strip(), *WORDS[words])
    assert requirements_of(SCENE, {found.name: WORDS[words]}).each == (found,)


def test_bounds_of_one_measure_are_gathered():
    every = ["speed>0.1", "period<2", "speed<0.9", "speed>0.3", "speed<0.7"]
    speed, period = Requirement("speed", 0.3, 0.7), Requirement("period", None, 2.0)
    assert requirements_of(SCENE, every).each == (speed, period)
    assert requirements_of(SCENE, None).each == ()
    equal = {"speed": (0.5, 0.5)}
    assert requirements_of(SCENE, equal).each == (Requirement("speed", 0.5, 0.5),)
    for wrong in (
        ["speed>0.5", "speed<0.4"], {"speed": (None, None)}, {"speed": 0.3}, {"speed": (0.1,)},
        {"speed": (np.nan, 1.0)}, "speed", "speed<", "speed<nan", "speed<2kg", 3, [3],
    ):  # fmt: skip
        with pytest.raises(ArgumentError):
            requirements_of(SCENE, wrong)


def test_what_is_worse_is_told_by_the_sense_and_by_the_bounds():
    bounded = Requirement("period", None, 2.0), Requirement("step_length", 0.1, None)
    assert larger_is_worse({"speed": 1.0}, -1.0, bounded) == {
        "speed": False, "period": True, "step_length": False
    }  # fmt: skip
    assert larger_is_worse({"speed": -1.0}, -1.0, ()) == {"speed": True}
    assert larger_is_worse({"speed": 1.0}, 1.0, (Requirement("speed", None, 1.0),))["speed"]
    for told, sense, rows in (
        ({"speed": 1.0}, 1.0, (Requirement("speed", 0.1, None),)),
        ({"speed": 1.0}, -1.0, (Requirement("period", 0.1, 0.2),)),
    ):
        with pytest.raises(ArgumentError, match="both sides"):
            larger_is_worse(told, sense, rows)


def test_a_scene_s_own_design_lies_within_the_bounds():
    scene = jb.with_parameters(SCENE, {"slope": 0.02})
    inside = ((0.01, 0.04), 0.5), ((-0.02, 0.06), 0.5)
    for bounds, u in (*inside, ((0.03, 0.05), 0.0), ((0.001, 0.01), 1.0)):
        assert start_of(scene, variables_of(scene, {"slope": bounds})) == pytest.approx([u])


def test_a_sum_has_the_weighted_parts():
    parts = [
        Functional(2.0, 0.1, np.array([1.0, 2.0]), np.array([0.1, 0.2])),
        Functional(5.0, 0.3, np.array([-1.0, 4.0]), np.array([0.3, 0.1])),
    ]
    value, error, slopes, bars = weighted_sum([2.0, -1.0], parts, 2)
    assert (value, error) == (-1.0, pytest.approx(0.5))
    np.testing.assert_allclose(slopes, [3.0, 0.0])
    np.testing.assert_allclose(bars, [0.5, 0.5])


def test_rows_are_requirements_one_by_one():
    bounds = {"speed": (0.2, 0.5), "period": (0.4, 0.4), "step_length": (-0.3, None)}
    rows = rows_of(formula_problem(BOTH, *FASTEST, bounds))
    assert rows == (
        Row("speed", 0.2, 1.0, False), Row("speed", 0.5, -1.0, False),
        Row("period", 0.4, 1.0, True), Row("step_length", -0.3, 1.0, False),
    )  # fmt: skip
    slopes, bars = np.array([1.0, -2.0]), np.array([0.1, 0.2])
    known = SimpleNamespace(
        values={"speed": 0.6, "step_length": -0.2}, slopes={"speed": slopes, "step_length": slopes},
        slope_errors={"speed": bars},
    )  # fmt: skip
    low, high, _, length = rows
    assert [each.value(known) for each in (low, high)] == pytest.approx([2.0, -0.2])
    assert length.value(known) == pytest.approx(0.1 / 0.3)
    np.testing.assert_allclose(high.slopes(known), -slopes / 0.5)
    np.testing.assert_allclose(high.slope_errors(known), bars / 0.5)
    assert [each.by_bound(known) for each in (low, high)] == pytest.approx([-5.0, 2.0])
    assert [each.is_active(known) for each in (low, high, length)] == [False, True, False]
    assert Row("speed", 0.2, 1.0, True).is_active(known)
    almost = known.values | {"speed": 0.5 * (1.0 - 0.5e-4)}
    assert high.is_active(SimpleNamespace(values=almost))


@pytest.mark.parametrize(
    "multipliers", [(0.5, 0.3, -0.2), (0.6, 0.1 + 0.4j, 0.1 - 0.4j), (-0.7, 0.2, 0.1)]
)
def test_conditions_are_kept_where_all_multipliers_lie_within_the_radius(multipliers):
    """And change with multipliers and radius as differences do."""
    polynomial = np.poly(multipliers).real
    symmetric = np.array([-polynomial[1], polynomial[2], -polynomial[3]])
    radius = max(map(abs, multipliers))
    assert radius_of(symmetric) == pytest.approx(radius)
    assert np.all(conditions(symmetric, 1.001 * radius).values > 0.0)
    assert np.min(conditions(symmetric, 0.999 * radius).values) < 0.0
    assert radius_of(symmetric, 1e-3) > radius
    kept = conditions(symmetric, radius_of(symmetric, 1e-3)).values
    assert np.min(kept) == pytest.approx(1e-3)
    told = conditions(symmetric, 0.8)
    for k, along in enumerate(1e-6 * np.eye(3)):
        pair = (conditions(symmetric + sign * along, 0.8).values for sign in (1.0, -1.0))
        np.testing.assert_allclose(told.by_symmetric[:, k], np.subtract(*pair) / 2e-6, atol=1e-8)
    pair = (conditions(symmetric, 0.8 + h).values for h in (1e-6, -1e-6))
    np.testing.assert_allclose(told.by_radius, np.subtract(*pair) / 2e-6, atol=1e-8)


def told_problem(function, u, **more):
    """Of one measure by a function of u that gives value, slopes, error and slopes' errors."""

    def objective(known, weights=None):
        return Functional(*known)

    def gradient(u, slopes):
        return np.asarray(slopes)

    designs = [Design(np.array(each), function(np.array(each))) for each in u]
    how = dict(weights={"speed": 1.0}, has_cluster=False, asked=designs)
    return SimpleNamespace(objective=objective, gradient=gradient, **how | more)


def bowl(u, tilt=0.0, error=0.0, bar=0.0):
    return 1.0 + u @ u, error, 2.0 * u + tilt, np.full(len(u), bar)


@pytest.mark.parametrize(
    ("how", "explained"),
    [
        (dict(), True),
        (dict(tilt=0.003), True),
        (dict(tilt=0.005), False),
        (dict(tilt=0.2), False),
        (dict(tilt=-0.2), False),
        (dict(tilt=0.2, bar=0.25), True),
        (dict(tilt=0.2, error=2e-3), True),
    ],
)
def test_derivatives_explain_the_difference_of_two_designs_or_do_not(how, explained):
    """A bowl whose derivatives are tilted; its own change counts a tenth, or an error bar all."""
    problem = told_problem(lambda u: bowl(u, **how), [[0.3, 0.3], [0.31, 0.29], [0.29, 0.3]])
    first, *others = problem.asked
    assert _explains(problem, first, others[1]) == explained
    assert _explains(problem, others[1], first) == explained


def test_designs_are_near_where_their_difference_shows_derivatives():
    here = Design(np.array([0.5, 0.5]), None)
    for move, near in (
        (0.9e-5, False),
        (1.1e-5, True),
        (-0.019, True),
        (0.021, False),
        (-0.3, False),
    ):
        assert is_near(here, Design(np.array([0.5, 0.5 + move]), None)) == near


def test_variables_at_bounds_and_those_that_were_not_tried():
    assert _at_bounds(np.array([0.0, 0.5, 1.0, 1e-7])) == [(0, 1.0), (3, 1.0), (2, -1.0)]
    begin = np.array([0.0, 0.5, 1.0])
    assert not is_untried(np.array([0.0, 0.6, 1.0]), begin)
    assert is_untried(np.array([0.2, 0.5, 1.0]), begin)
    assert is_untried(np.array([0.2, 0.5 + 1e-7, 0.3]), begin)


def test_an_objective_is_flat_where_no_design_has_a_derivative_beyond_its_error():
    def level(u):
        return 2.0, 0.0, np.array([1e-7, 0.0]), np.zeros(2)

    assert is_flat(told_problem(level, [[0.1, 0.2], [0.3, 0.2]]))
    assert not is_flat(told_problem(level, [[0.1, 0.2]]))
    assert not is_flat(told_problem(bowl, [[0.0, 0.0], [0.3, 0.2]]))
    assert is_flat(told_problem(lambda u: bowl(u, bar=0.3), [[0.0, 0.0], [0.3, 0.2]]))
    assert not is_flat(told_problem(lambda u: bowl(u, bar=0.1), [[0.0, 0.0], [0.3, 0.2]]))


def test_the_radius_is_a_variable_of_its_own_where_it_is_minimised():
    weights = {"speed": 2.0, "spectral_radius": 3.0}
    problem = SimpleNamespace(weights=weights, has_cluster=True)
    assert smooth_weights(problem) == ({"speed": 2.0}, 3.0)
    assert weights["spectral_radius"] == 3.0
    for other in (
        dict(has_cluster=False), dict(weights=weights | {"spectral_radius": -3.0}),
        dict(weights={"speed": 2.0}),
    ):  # fmt: skip
        changed = SimpleNamespace(**vars(problem) | other)
        assert smooth_weights(changed) == (changed.weights, 0.0)


def test_a_front_bounds_its_second_measure_alone():
    with pytest.raises(ArgumentError, match="subject_to has 'speed' already"):
        jb.optimise.pareto_front(
            SCENE,
            vary={"d": (0.09, 0.11)},
            maximise="step_length",
            against="speed",
            bounds=[0.4],
            subject_to="speed>0.3",
        )

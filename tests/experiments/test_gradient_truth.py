"""Truth of gradients: the ball's closed form against SciPy, and the experiment's quick run."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

sys.path.insert(0, str(Path(__file__).parents[2] / "experiments"))
from _ball_closed_form import PROBLEMS, Problem, closed_form


def _followed(problem: Problem) -> np.ndarray:
    """SciPy's solution, phase by phase between touchdown and release."""
    g, K, c = problem.g, problem.K, problem.c

    def falling(t, y):
        return y[1], -g

    def damping(v):
        return c * (v if problem.damps_rebound else min(v, 0.0))

    def pushed(t, y):
        return y[1], -g * problem.weight_in_contact - K * y[0] - damping(y[1])

    def touchdown(t, y):
        return y[0]

    def release(t, y):
        return K * y[0] + damping(y[1])

    touchdown.direction, touchdown.terminal = -1.0, True
    release.direction, release.terminal = 1.0, True
    t, y, in_contact = 0.0, np.array([problem.height, 0.0]), False
    while t < problem.duration:
        rates, event = (pushed, release) if in_contact else (falling, touchdown)
        span = (t, problem.duration)
        found = solve_ivp(rates, span, y, "DOP853", events=event, rtol=1e-12, atol=1e-14)
        t, y, in_contact = found.t[-1], found.y[:, -1], not in_contact
    return y


OTHER_LAWS = (
    dataclasses.replace(PROBLEMS[0], name="no weight in contact", weight_in_contact=0.0),
    dataclasses.replace(PROBLEMS[1], name="damped while it sinks", damps_rebound=False),
)


@pytest.mark.parametrize("problem", [*PROBLEMS, *OTHER_LAWS], ids=lambda problem: problem.name)
def test_the_closed_form_is_what_scipy_finds(problem):
    truth = closed_form(problem)
    assert truth.bounces == 3
    assert truth.uncertainty < 1e-20
    assert _followed(problem) == pytest.approx(truth.state, rel=1e-8)


def test_derivatives_are_scipys_differences():
    problem = PROBLEMS[1]
    names, step = problem.parameters, 1e-5
    for column, name in enumerate(names):
        value = getattr(problem, name)
        ends = [
            _followed(Problem(**{**vars(problem), name: value * (1.0 + sign * step)}))
            for sign in (1.0, -1.0)
        ]
        slopes = (ends[0] - ends[1]) / (2.0 * step)
        truth = np.array(closed_form(problem).gradient)[:, column]
        assert slopes == pytest.approx(truth, rel=1e-4), name


@pytest.mark.nightly
def test_only_our_gradients_are_right_and_know_it(tmp_path):
    numbers, figures = quick_run("gradient_truth", tmp_path)
    assert_is_drawn(figures["gradient_truth.png"])
    answered = [row for row in numbers["rows"] if row["outcome"] == "answered"]
    own = [row for row in answered if row["way"] == "jaxbiped"]
    assert {row["problem"] for row in own} == {problem.name for problem in PROBLEMS}
    for row in own:
        assert row["gradient_error"] < 1e-2
        assert row["gradient_error"] <= row["said"] < 0.1
    assert min(row["gradient_error"] for row in answered if row["setting"] == "dt") > 0.1

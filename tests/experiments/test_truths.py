"""Truths of gradients: closed form and collocation against SciPy, and what tools say of them."""

import dataclasses
from importlib.metadata import version

import _gradient_ways
import numpy as np
import pytest
from _ball_closed_form import PROBLEMS, closed_form
from reference.collocation import radau
from reference.compliant import numbers
from reference.footstep import LAWS, MID_STANCE, PARAMETERS, footstep
from scipy.integrate import solve_ivp

from tests.experiments.quick import drawn_run


def _followed(problem):
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


def test_derivatives_of_the_closed_form_are_scipys_differences():
    problem, step = PROBLEMS[1], 1e-5
    for column, name in enumerate(problem.parameters):
        value = getattr(problem, name)
        ends = [
            _followed(dataclasses.replace(problem, **{name: value * (1.0 + sign * step)}))
            for sign in (1.0, -1.0)
        ]
        slopes = (ends[0] - ends[1]) / (2.0 * step)
        truth = np.array(closed_form(problem).gradient)[:, column]
        assert slopes == pytest.approx(truth, rel=1e-4), name


def test_radau_is_of_its_order():
    """The last row integrates powers exactly up to twice the stages less two, and no further."""
    nodes, matrix, _, last = radau(4)
    for power in range(7):
        assert matrix[-1] @ nodes**power == pytest.approx(1.0 / (power + 1), abs=1e-14)
    assert matrix[-1] @ nodes**7 != pytest.approx(1.0 / 8.0, abs=1e-6)
    assert last @ nodes**2 == pytest.approx(0.0, abs=1e-14)
    assert abs(last @ nodes**3) > 1e-2


@pytest.mark.slow
def test_derivatives_of_the_footstep_are_differences():
    """Along one direction in all numbers of the start and in the laws at once."""
    found, h, random = footstep(), 1e-6, np.random.default_rng(0)
    start, logs = np.append(0.0, random.standard_normal(7)), random.standard_normal(4)

    def at(step):
        laws = dict(zip(PARAMETERS, LAWS * np.exp(step * logs), strict=True))
        end = footstep(MID_STANCE + step * start, numbers(**laws))
        return np.append(end.time, end.state)

    rows = np.vstack([found.time_gradient, found.gradient]) @ np.append(start, logs)
    slopes = (at(h) - at(-h)) / (2.0 * h)
    assert slopes == pytest.approx(rows, rel=1e-5, abs=1e-6 * np.max(np.abs(rows)))


@pytest.mark.nightly
def test_only_our_gradients_through_contact_are_right_and_know_it(tmp_path):
    numbers, _ = drawn_run("gradient_truth", tmp_path)
    answered = [row for row in numbers["rows"] if row["outcome"] == "answered"]
    own = [row for row in answered if row["way"] == "jaxbiped"]
    assert {row["problem"] for row in own} == {problem.name for problem in PROBLEMS}
    for row in own:
        assert row["gradient_error"] < 1e-2
        assert row["gradient_error"] <= row["said"] < 0.1
    assert min(row["gradient_error"] for row in answered if row["setting"] == "dt") > 0.1
    walked = numbers["footstep"]
    assert walked["problem"]["coarser_collocation"] < 1e-9
    assert walked["problem"]["our_finest"] < 2e-8
    *own, peer = walked["rows"]
    assert {row["way"] for row in own} == {"jaxbiped"}
    for row in own:
        assert row["gradient_error"] <= row["said"] < 0.1
    # Differences of solves at 1e-4, by the best of their steps.
    assert peer["gradient_error"] > 10.0 * own[0]["gradient_error"]
    assert peer["said"] is None


def test_versions_are_those_installed():
    found = _gradient_ways.versions()
    assert found["jax"] == version("jax")
    assert set(found) == set(_gradient_ways.PACKAGES)

"""Torques of an optimum's motors as they are drawn, against the law and slopes by hand."""

import dataclasses
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.optimise import TorqueGap
from tests.optimise.test_costs_of_motion import DRIVEN, KD, KP, START, TARGET
from tests.plot.test_fit_charts import _optimum

TIMES = np.array([0.0, 0.2, 0.5])
GAP = TorqueGap(1e-3, 1e-9, TIMES, {"hip": np.array([0.3, -0.2, 0.1])}, 8)


@pytest.fixture(scope="module")
def best():
    gait = jb.find_gait(DRIVEN, START, parameters=(), radius_sensitivities=False)
    problem = SimpleNamespace(weights={"speed": 1.0})
    return dataclasses.replace(_optimum(scene=DRIVEN), gait=gait, problem=problem)


def test_torques_are_those_of_the_law_over_the_cycle(best):
    (line,) = plot.motor_torques(best).axes[0].lines
    times, torques = line.get_xydata().T
    measures = best.gait.measures
    assert times[0] == 0.0
    assert 0.9 * float(measures.period) < times[-1] < float(measures.period)
    how = dict(duration=float(measures.period), save=jnp.asarray(times))
    state = jb.simulate(DRIVEN, measures.state, **how).state
    angle, rate = state.theta_leg_1 - state.theta_leg_2, state.omega_leg_1 - state.omega_leg_2
    np.testing.assert_allclose(torques, -KP * (angle - TARGET) - KD * rate, rtol=1e-12, atol=1e-12)


def test_a_gap_has_a_panel_with_its_slopes(best):
    figure = plot.motor_torques(best, GAP)
    _, right = figure.axes
    (line,) = right.lines
    np.testing.assert_array_equal(line.get_xydata().T, [TIMES, GAP.switching["hip"]])
    assert right.get_ylabel().endswith("((m/s)/(N m s))")
    assert [text.get_text() for text in right.get_legend().get_texts()] == ["hip"]


def test_what_has_no_motors_is_refused(best):
    gait = jb.find_gait(jb.ladder()["rigid"], parameters=(), radius_sensitivities=False)
    passive = dataclasses.replace(_optimum(), gait=gait)
    with pytest.raises(jb.ArgumentError, match="no motors"):
        plot.motor_torques(passive)
    with pytest.raises(jb.ArgumentError, match="gap"):
        plot.motor_torques(best, 0.1)

"""Gaits to a wanted accuracy, against finer solves by another method."""

import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow
SCENE = jb.seed_scene()
HOW = dict(parameters=("K",), engine="lanes")


@pytest.fixture(scope="module")
def gait():
    return jb.find_gait(SCENE, accuracy=1e-2, **HOW)


def test_the_bars_hold_what_a_finer_solve_by_another_method_changes(gait):
    exact = jb.find_gait(SCENE, gait.measures.state, accuracy="tight", solver="rodas4p", **HOW)
    error, bars = gait.error, gait.error.bars
    assert error.met
    assert error.relative <= 1e-2
    for name in ("period", "step_length", "speed", "peak_normal"):
        told, true, bar = (
            getattr(each, name) for each in (gait.measures, exact.measures, bars["measures"])
        )
        assert abs(float(told) - float(true)) <= float(bar), name
    change = np.abs(np.asarray(gait.multipliers) - np.asarray(exact.multipliers))
    assert np.all(change <= bars["multipliers"] + np.asarray(exact.multiplier_errors))
    for name in ("period", "spectral_radius"):
        told, true, bar = (
            np.asarray(getattr(each, name))
            for each in (gait.sensitivities, exact.sensitivities, bars["sensitivities"])
        )
        assert np.all(np.abs(told - true) <= bar), name


def test_draft_tells_measures_to_a_hundredth_in_a_third_of_the_steps():
    draft, balanced = (jb.find_gait(SCENE, accuracy=name, **HOW) for name in ("draft", "balanced"))
    assert 3 * int(draft.solver_steps) <= int(balanced.solver_steps)
    for name in ("period", "step_length", "speed", "peak_normal", "spectral_radius"):
        told, true = (float(getattr(each.measures, name)) for each in (draft, balanced))
        assert told == pytest.approx(true, rel=1e-2), name
    assert draft.error is None
    assert balanced.error is None


@pytest.mark.parametrize(
    ("accuracy", "words"),
    [(0.0, "accuracy = 0 is not allowed"), ("fine", "choose one of draft, balanced, tight")],
)
def test_bad_accuracies_cost_one_sentence(accuracy, words):
    with pytest.raises(jb.ArgumentError, match=words):
        jb.find_gait(SCENE, accuracy=accuracy)

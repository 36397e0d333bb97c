"""Gaits of eight mechanisms against collocation in maximal coordinates, written independently."""

import functools

import numpy as np
import pytest
from _mechanisms import cases
from reference.mechanism_flow import checked_cycle
from reference.mechanism_pieces import Field, pieces_at

import jaxbiped as jb
from tests.mechanism_numbers import directions_of, tree_of

CASES = cases()
NIGHTLY = [
    pytest.param(name, marks=() if name == "torso coupled" else pytest.mark.nightly)
    for name in CASES
]


@pytest.mark.parametrize("name", CASES)
def test_fields_are_those_of_maximal_coordinates(name):
    scene, start = CASES[name].scene, CASES[name].guess
    tree, first = tree_of(scene), np.array([float(leaf) for leaf in start])
    random, met = np.random.default_rng(0), set()
    for k in range(20):
        # Lower and lower, with feet on the ground, stops that are pressed, and slip.
        y = first + (0.3 * random.standard_normal(len(first)) if k else 0.0)
        y[1] = first[1] - 2e-3 * k
        pieces = pieces_at(tree, y)
        met |= set(enumerate(pieces.pressing))
        expected = Field(tree, pieces)(y, tree.p)
        there = jb.dynamics.vector_field(0.0, type(start)(*y), scene)
        found = np.array([float(leaf) for leaf in there])
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    # Each contact was seen free and pressed.
    assert len(met) >= 2 * len(pieces.pressing), met


@functools.cache
def both(name):
    """The gait at tight, with derivatives of its period by all parameters, and the check's."""
    scene = CASES[name].scene
    gait = jb.find_gait(scene, CASES[name].guess, accuracy="tight", radius_sensitivities=False)
    assert gait.outcome is jb.gait.Search.FOUND
    checked = checked_cycle(
        tree_of(scene),
        gait.measures.state,
        float(gait.measures.period),
        directions_of(scene, gait.parameters),
        exchanges=gait.cycle == "step",
    )
    return gait, checked


@pytest.mark.slow
@pytest.mark.parametrize("name", NIGHTLY)
def test_gaits_are_those_of_maximal_coordinates(name):
    gait, checked = both(name)
    assert checked.residual < 5e-9
    period = float(gait.measures.period)
    assert period == pytest.approx(checked.period, abs=1e-9)
    # The check's has the flow's own direction among them, which must be 1.
    own = np.append(1.0, np.asarray(gait.multipliers))[: len(checked.multipliers)]
    away = np.abs(own[:, None] - checked.multipliers[None, :])
    assert away.min(axis=0).max() < 1e-6
    assert away.min(axis=1).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", NIGHTLY)
def test_sensitivities_are_within_their_bars(name):
    gait, checked = both(name)
    found, bars = (
        np.asarray(each.period) for each in (gait.sensitivities, gait.sensitivity_errors)
    )
    misses = np.abs(found - checked.slopes) / bars
    assert misses.max() < 1.0, dict(zip(gait.parameters, misses.tolist(), strict=True))
    np.testing.assert_allclose(found, checked.slopes, rtol=1e-4, atol=1e-9 * np.abs(found).max())


@pytest.mark.slow
def test_a_derivative_through_corners_of_friction_keeps_no_error_of_the_crossing():
    """By the damping c; the value is that of a collocation by nine stages (`checked_cycle`)."""
    case = CASES["torso on a spring"]
    gait = jb.find_gait(
        case.scene, case.guess, accuracy="tight", parameters=("c",), radius_sensitivities=False
    )
    assert float(gait.sensitivities.period[0]) == pytest.approx(-6.27446239523e-11, rel=1e-8)


@pytest.mark.slow
def test_derivatives_of_the_peak_fall_with_the_tolerance():
    """Against another method's. The foot sticks at 1e7/s: a state that a step leaves off what
    friction slows to so fast has rates that are off by more, and by these the peak's time."""
    case = CASES["torso on a spring"]

    def peak(rtol, tangent_rtol, solver="rodas4"):
        accuracy = jb.ACCURACIES["tight"].gait._replace(rtol=rtol, tangent_rtol=tangent_rtol)
        how = dict(accuracy=accuracy, solver=solver, parameters=("slope", "n"))
        gait = jb.find_gait(case.scene, case.guess, radius_sensitivities=False, **how)
        return np.asarray(gait.elasticities.peak_normal)

    exact = peak(1e-10, 1e-10, "rodas5p")
    for rtol in (1.8e-9, 5.6e-10, 3.2e-10):
        np.testing.assert_allclose(peak(rtol, 10.0 * rtol), exact, rtol=2e-9)

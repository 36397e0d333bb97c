"""Fits of linear models, against their estimates and errors in closed form."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.identify import _fit_gait
from jaxbiped.identify._interval_end import interval_end, linear_step
from jaxbiped.identify._predicted_gait import Prediction, predict
from tests.mechanisms import scene_of

SCENE = jb.ladder()["rigid"]
SEEN = jb.identify.MeasuredGait(
    {"period": (0.5, 0.01), "step_length": (0.2, 0.02), "speed": (0.35, 0.03)}
)


@pytest.fixture
def predicts(monkeypatch):
    """Lets fits predict by a model instead of by gaits."""
    return lambda model: monkeypatch.setattr(_fit_gait, "predict", model)


def linear(matrix, center, scene=SCENE):
    """Predicts center + matrix · log(parameters / the scene's own)."""
    own = jb.parameter_values(scene)

    def predicted(scene, measured, values, sizes, guess, **how):
        names = list(values)
        logs = np.log([values[name] / float(own[name]) for name in names])
        zero = np.zeros_like(matrix)
        return Prediction(center + matrix @ logs, matrix, zero, (), (), True)

    return predicted


@pytest.mark.parametrize("vary", [("J",), ("J", "d")])
def test_a_linear_model_has_the_covariance_of_least_squares(vary, predicts):
    """(AᵀA)⁻¹ of the weighed slopes, and intervals of 1.96 standard errors in the logarithm."""
    matrix = np.array([[0.3, -0.1], [0.1, 0.4], [0.2, 0.3]])[:, : len(vary)]
    off = np.array([0.02, -0.01, 0.03])
    predicts(linear(matrix, SEEN.values + off))
    fit = jb.fit_gait(SCENE, vary, SEEN)
    weighed = matrix / SEEN.deviations[:, None]
    covariance = np.linalg.inv(weighed.T @ weighed)
    logs = -covariance @ weighed.T @ (off / SEEN.deviations)
    own = jb.parameter_values(SCENE)
    spread = np.sqrt(np.diag(covariance))
    for k, name in enumerate(vary):
        value = float(own[name]) * np.exp(logs[k])
        assert fit.estimates[name] == pytest.approx(value, rel=1e-7)
        assert fit.standard_errors[name] == pytest.approx(value * spread[k], rel=1e-7)
        ends = value * np.exp(np.array([-1.959964, 1.959964]) * spread[k])
        assert fit.intervals[name] == pytest.approx(tuple(ends), rel=1e-6)
    np.testing.assert_allclose(fit.correlation, covariance / np.outer(spread, spread), rtol=1e-8)
    expected = matrix @ logs + off
    np.testing.assert_allclose(fit.residuals, expected / SEEN.deviations, atol=1e-7)
    assert fit.chi_squared == pytest.approx(float(np.sum((expected / SEEN.deviations) ** 2)))
    assert fit.freedom == 3 - len(vary)
    assert fit.ending is jb.identify.FitEnding.CONVERGED
    assert fit.undetermined == ()


@pytest.mark.parametrize("bent", [False, True])
def test_an_end_at_a_bound_is_none_that_data_set(bent, predicts):
    """One number, log J ± σ: chi squared grows by a quarter of what an end takes to the bound above
    it, by all of it below; and by less on both sides where the bounds are narrow."""
    deviation = 0.1 if bent else 0.01  # followed by further scenes, or linear
    predicts(linear(np.ones((1, 1)), np.ones(1)))
    seen = jb.identify.MeasuredGait({"period": (1.0, deviation)})
    own = float(jb.parameter_values(SCENE)["J"])
    low, near = own * np.exp(-1.959964 * deviation), own * np.exp(0.5 * 1.959964 * deviation)
    fit = jb.fit_gait(SCENE, {"J": (0.5 * own, near)}, seen)
    assert (fit.one_sided, fit.undetermined, fit.at_bounds) == (("J",), (), ())
    assert fit.intervals["J"] == pytest.approx((low, near), rel=1e-6)
    assert "limited on one side: J" in repr(fit)
    assert fit.to_dataset().one_sided.item() == 1
    wide = jb.fit_gait(SCENE, {"J": (0.5 * own, 2.0 * own)}, seen)
    assert (wide.one_sided, wide.undetermined) == ((), ())
    narrow = jb.fit_gait(SCENE, {"J": (own**2 / near, near)}, seen)
    assert narrow.undetermined == ("J",)
    assert np.isnan(narrow.intervals["J"]).all()


def test_a_bound_beyond_which_nothing_fits_is_no_end():
    """A residual that bends: by its derivatives the end lies beyond the limit, in truth before."""
    model = lambda x: (2.0 * x + x**3, 2.0 + 3.0 * x[:, None] ** 2)
    known = model(np.zeros(1))
    end = np.roots([1.0, 0.0, 2.0, -1.96])
    expected = float(end[np.isreal(end)][0].real)
    limits = np.array([[-5.0], [0.9]])
    found = interval_end(model, np.zeros(1), known, 1.96**2, 0, 1.0, limits)
    assert found == pytest.approx(expected, rel=0.01)
    assert interval_end(model, np.zeros(1), known, 1.96**2, 0, 1.0, 0.1 * limits) == np.inf


def test_parameters_below_zero_are_fitted_as_those_above(predicts):
    """Estimates, errors and correlations of parameters of both signs, by linear least squares."""
    names, matrix = ("torso.centre", "torso.mass"), np.array([[0.3, -0.1], [0.1, 0.4], [0.2, 0.3]])
    scene = scene_of("torso")
    scene = jb.with_parameters(scene, {"torso.centre": -0.15})
    off = np.array([0.002, -0.001, 0.003])
    predicts(linear(matrix, SEEN.values + off, scene))
    own = np.array([float(jb.parameter_values(scene)[name]) for name in names])
    weighed = matrix / SEEN.deviations[:, None]
    covariance = np.linalg.inv(weighed.T @ weighed)
    values = own * np.exp(-covariance @ weighed.T @ (off / SEEN.deviations))
    for vary in (names, {"torso.centre": (-1.5, -0.01), "torso.mass": (0.01, 50.0)}):
        fit = jb.fit_gait(scene, vary, SEEN)
        spread = np.abs(values) * np.sqrt(np.diag(covariance))
        assert np.all(np.abs(np.array(list(fit.estimates.values())) - values) < 0.02 * spread)
        assert list(fit.standard_errors.values()) == pytest.approx(spread, rel=1e-2)
        by_parameters = covariance * np.outer(values, values) / np.outer(spread, spread)
        np.testing.assert_allclose(fit.correlation, by_parameters, rtol=1e-6)
        low, high = fit.intervals["torso.centre"]
        assert low < fit.estimates["torso.centre"] < high < 0.0


@pytest.mark.parametrize("first", [0.03, 0.0, -0.04])
def test_between_bounds_that_hold_zero_a_parameter_changes_its_sign(first, predicts):
    """A line in the parameter itself, whose truth lies below zero: its estimate and errors."""
    truth, rate = -0.02, np.array([[3.0], [0.0], [1.0]])

    def predicted(scene, measured, values, sizes, guess, **how):
        moved = rate @ (np.array(list(values.values())) - truth)
        return Prediction(SEEN.values + moved, rate * sizes, 0.0 * rate, (), (), True)

    predicts(predicted)
    scene = jb.with_parameters(SCENE, {"slope": first})
    fit = jb.fit_gait(scene, {"slope": (-0.05, 0.1)}, SEEN)
    error = 1.0 / np.linalg.norm(rate[:, 0] / SEEN.deviations)
    assert fit.estimates["slope"] == pytest.approx(truth, abs=0.02 * error)
    assert fit.standard_errors["slope"] == pytest.approx(error)
    assert fit.intervals["slope"] == pytest.approx(
        (truth - 1.96 * error, truth + 1.96 * error), abs=0.05 * error
    )
    with pytest.raises(jb.ArgumentError, match=r"slope"):
        jb.fit_gait(scene, {"slope": (-2.0, 0.1)}, SEEN)


def test_two_parameters_that_make_up_for_each_other_are_told(predicts):
    matrix = np.outer([0.3, 0.1, 0.2], [1.0, -2.0])
    predicts(linear(matrix, SEEN.values))
    fit = jb.fit_gait(SCENE, ("J", "d"), SEEN)
    assert fit.undetermined == ("J", "d")
    assert np.isnan(fit.standard_errors["J"])
    assert fit.freedom == 2  # one combination of both is told


def test_a_bound_that_holds_a_parameter_is_named_and_takes_its_interval(predicts):
    """The other's interval is the profile within the bounds: the end where none is held."""
    matrix = np.array([[0.3, -0.1], [0.1, 0.4], [0.2, 0.3]])
    predicts(linear(matrix, SEEN.values))
    own = {name: float(jb.parameter_values(SCENE)[name]) for name in ("J", "d")}
    start = jb.with_parameters(SCENE, {"J": 1.1 * own["J"]})
    bounds = {"J": (1.05 * own["J"], 2.0 * own["J"]), "d": (0.5 * own["d"], 2.0 * own["d"])}
    fit = jb.fit_gait(start, bounds, SEEN)
    assert fit.at_bounds == ("J",)
    assert fit.undetermined == ()
    assert np.isnan(fit.intervals["J"]).all()
    weighed = matrix / SEEN.deviations[:, None]
    at = np.array([np.log(1.05), np.log(fit.estimates["d"] / own["d"])])
    square = np.sum((weighed @ at) ** 2) + 1.959964**2
    tried = np.linspace(np.log(0.5), np.log(2.0), 400001)
    for end, place in zip(fit.intervals["d"], (0, -1), strict=True):
        # The best J for each d, at its bound at least.
        best = -tried * (weighed[:, 0] @ weighed[:, 1]) / (weighed[:, 0] @ weighed[:, 0])
        best = np.maximum(best, np.log(1.05))
        squares = np.sum((np.outer(best, weighed[:, 0]) + np.outer(tried, weighed[:, 1])) ** 2, 1)
        assert np.log(end / own["d"]) == pytest.approx(tried[squares <= square][place], abs=1e-4)


def test_an_interval_follows_the_profile_where_the_model_bends(predicts):
    """y = K (1 − e^(−c)) measured once well and c badly: the profile's ends, found on a grid."""

    def curve(k, c):
        return np.array([k * (1.0 - np.exp(-c)), c, 0.0 * k])

    def predicted(scene, measured, values, sizes, guess, **how):
        k, c = (values[name] / float(jb.parameter_values(SCENE)[name]) for name in ("J", "d"))
        slopes = np.array([[k * (1 - np.exp(-c)), k * c * np.exp(-c)], [0.0, c], [0.0, 0.0]])
        return Prediction(curve(k, c), slopes, 0.0 * slopes, (), (), True)

    predicts(predicted)
    seen = jb.identify.MeasuredGait(
        {"period": (0.632, 0.01), "step_length": (1.0, 0.35), "speed": (0.0, 1.0)}
    )
    fit = jb.fit_gait(SCENE, ("J", "d"), seen)
    own = jb.parameter_values(SCENE)
    c = np.linspace(0.05, 2.5, 200001)
    tried = np.linspace(0.5, 2.5, 4001)
    profile = np.array([
        np.min(((k * (1.0 - np.exp(-c)) - 0.632) / 0.01) ** 2 + ((c - 1.0) / 0.35) ** 2)
        for k in tried
    ])  # fmt: skip
    inside = tried[profile <= 1.959964**2]
    found = np.array(fit.intervals["J"]) / float(own["J"])
    assert found == pytest.approx([inside[0], inside[-1]], rel=0.01)
    # The linearised ends are off by a tenth and more.
    spread = fit.standard_errors["J"] / float(own["J"])
    assert abs(np.exp(1.959964 * spread) / inside[-1] - 1.0) > 0.05


@pytest.mark.parametrize(("tilt", "bend"), [(0.1, 0.5), (0.03, 1.0)])
def test_an_interval_ends_in_a_bent_valley_where_derivatives_alone_would_cycle(
    tilt, bend, predicts
):
    """y₁ = x + tilt y − bend y², measured 40 times better than y₂ = y: each y has its own x."""

    def predicted(scene, measured, values, sizes, guess, **how):
        x, y = (np.log(values[n] / float(jb.parameter_values(SCENE)[n])) for n in ("J", "d"))
        slopes = np.array([[1.0, tilt - 2.0 * bend * y], [0.0, 1.0], [0.0, 0.0]])
        told = np.array([x + tilt * y - bend * y**2, y, 0.0])
        return Prediction(told, slopes, 0.0 * slopes, (), (), True)

    predicts(predicted)
    seen = {"period": (0.0, 0.002), "step_length": (0.0, 0.08), "speed": (0.0, 1.0)}
    fit = jb.fit_gait(SCENE, ("J", "d"), jb.identify.MeasuredGait(seen))
    assert (fit.one_sided, fit.undetermined) == ((), ())
    y = np.linspace(-1.0, 1.0, 200001) * 0.08 * 1.959964
    spare = 0.002 * np.sqrt(np.maximum(1.959964**2 - (y / 0.08) ** 2, 0.0))
    ridge = bend * y**2 - tilt * y
    own, low, high = jb.parameter_values(SCENE), np.min(ridge - spare), np.max(ridge + spare)
    found = np.log(np.array(fit.intervals["J"]) / float(own["J"]))
    assert found == pytest.approx([low, high], abs=0.02 * (high - low))
    found = np.log(np.array(fit.intervals["d"]) / float(own["d"]))
    assert found == pytest.approx([y[0], y[-1]], rel=0.02)
    assert fit.evaluations <= 30


def test_a_parameter_may_be_limited_on_one_side_and_moves_the_others(predicts):
    """y₁ = log c − log(1 + K) and y₂ = K / (1 + K), which is best where K vanishes. No derivative
    tells of K there, but larger ones fit within the 95 %, too, and c with them."""

    def predicted(scene, measured, values, sizes, guess, **how):
        k, c = (values[name] / float(jb.parameter_values(SCENE)[name]) for name in ("J", "d"))
        told = np.array([np.log(c) - np.log1p(k), k / (1.0 + k) + 0.2, 0.0])
        slopes = np.array([[-k / (1.0 + k), 1.0], [k / (1.0 + k) ** 2, 0.0], [0.0, 0.0]])
        return Prediction(told, slopes, np.full((3, 2), 1e-6), (), (), True)

    predicts(predicted)
    seen = jb.identify.MeasuredGait(
        {"period": (1e-9, 0.1), "step_length": (1e-9, 0.5), "speed": (1e-9, 1.0)}
    )
    fit = jb.fit_gait(SCENE, ("J", "d"), seen)
    assert (fit.one_sided, fit.undetermined) == (("J",), ())
    assert np.isnan(fit.standard_errors["J"])
    c = np.linspace(-0.5, 2.5, 3001)
    share = np.linspace(0.0, 0.99, 2001)[:, None]  # K / (1 + K)
    squares = ((c + np.log1p(-share)) / 0.1) ** 2 + ((share + 0.2) / 0.5) ** 2
    within = squares <= fit.chi_squared + 1.959964**2
    own, inside = jb.parameter_values(SCENE), c[np.any(within, axis=0)]
    found = np.log(np.array(fit.intervals["d"]) / float(own["d"]))
    assert found == pytest.approx([inside[0], inside[-1]], abs=0.01)
    most = np.max(share[np.any(within, axis=1)])
    assert fit.intervals["J"] == pytest.approx(
        (0.0, float(own["J"]) * most / (1.0 - most)), rel=0.02
    )


@pytest.mark.parametrize("told", [1.0, 10.0, 1e3])
@pytest.mark.parametrize(("bend", "sign"), [(0.2, 1.0), (1.0, 1.0), (1.0, -1.0)])
def test_an_end_costs_few_evaluations_however_well_the_data_tell_it(told, bend, sign):
    """Residuals t (x + b x²/2) and 0.3, so that t (x + b x²/2) is 1.96 at the end."""
    bend, asked = bend * told / 2.0 / 1.96 * (1.0 if sign > 0.0 else 0.9), []

    def model(x):
        asked.append(x)
        residuals = np.array([told * (x[0] + 0.5 * bend * x[0] ** 2), 0.3])
        return residuals, np.array([[told * (1.0 + bend * x[0])], [0.0]])

    known = model(np.zeros(1))
    limits = np.array([[-np.inf], [np.inf]])
    end = interval_end(model, np.zeros(1), known, 0.09 + 1.96**2, 0, sign, limits)
    expected = (np.sqrt(1.0 + 2.0 * bend * sign * 1.96 / told) - 1.0) / bend
    assert end == pytest.approx(expected, rel=1e-4)
    assert len(asked) <= 6


@pytest.mark.parametrize("spare", [0.01, 0.5, 4.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_linear_step_ends_where_the_sum_of_squares_is_what_it_may_be(spare, sign):
    """At the point of an ellipsoid that is farthest along one axis, by Lagrange."""
    random = np.random.default_rng(2)
    slopes, residuals = random.standard_normal((6, 3)), random.standard_normal(6)
    least = residuals - slopes @ np.linalg.pinv(slopes) @ residuals
    square = float(least @ least) + spare
    room = np.array([[-100.0] * 3, [100.0] * 3])
    step, flat, worth = linear_step(residuals, slopes, square, 1, sign, room)
    covariance = np.linalg.inv(slopes.T @ slopes)
    best = -covariance @ slopes.T @ residuals
    np.testing.assert_allclose(
        step, best + sign * np.sqrt(spare / covariance[1, 1]) * covariance[1], rtol=1e-9
    )
    assert np.sum((residuals + slopes @ step) ** 2) == pytest.approx(square)
    assert (flat, worth) == (0.0, pytest.approx(np.sqrt(spare / covariance[1, 1])))


@pytest.mark.parametrize("far", [1.0, 10.0])
def test_no_end_is_told_where_a_derivative_dies_out(far, predicts):
    """y = K / (1 + K / far) was measured 0.67 standard deviations below what it comes to at last,
    and 2.67 above nothing: K has a lower end alone, where y lies 1.96 below the measured value."""

    def predicted(scene, measured, values, sizes, guess, **how):
        k = values["J"] / float(jb.parameter_values(SCENE)["J"])
        share = 1.0 / (1.0 + k / far)
        slopes = np.array([[k * share**2], [0.0], [0.0]])
        told = np.array([k * share, 0.2, 0.35])
        return Prediction(told, slopes, np.full((3, 1), 1e-9), (), (), True)

    predicts(predicted)
    seen = {"period": (0.8 * far, 0.3 * far), "step_length": (0.2, 0.02), "speed": (0.35, 0.03)}
    fit = jb.fit_gait(SCENE, ("J",), jb.identify.MeasuredGait(seen))
    assert fit.one_sided == ("J",)
    share = 0.8 - 1.959964 * 0.3
    lowest = far * share / (1.0 - share) * float(jb.parameter_values(SCENE)["J"])
    assert fit.intervals["J"] == pytest.approx((lowest, np.inf), rel=0.01)


def test_a_fit_that_does_not_fit_says_so(predicts):
    matrix = np.array([[0.3], [0.1], [0.2]])
    off = np.array([0.1, -0.1, 0.0])
    predicts(linear(matrix, SEEN.values + off))
    with pytest.warns(RuntimeWarning, match="the model does not fit the data: chi squared is"):
        fit = jb.fit_gait(SCENE, ("J",), SEEN)
    # Of two degrees of freedom the tail is exp(−χ²/2).
    assert fit.p_value == pytest.approx(np.exp(-0.5 * fit.chi_squared))


def test_without_a_gait_nothing_is_fitted(predicts):
    def lost(*_, **__):
        return Prediction(SEEN.values, np.ones((3, 1)), np.zeros((3, 1)), (), (), False)

    predicts(lost)
    fit = jb.fit_gait(SCENE, ("J",), SEEN)
    assert fit.ending is jb.identify.FitEnding.NO_GAIT
    assert fit.evaluations == 9  # the start, and others about it


def test_a_prediction_is_of_the_conditions_in_units_of_the_parameters():
    """Those of a gait that is searched under them, to the last bit."""
    seen = jb.identify.MeasuredGait(
        {"step_length": (0.1, 0.01), "period": (0.5, 0.01)}, conditions={"slope": 0.05}, footsteps=2
    )
    values, sizes = {"J": 0.02, "d": 0.1}, np.array([0.02, 10.0])
    found = predict(SCENE, seen, values, sizes, None, accuracy="tight", engine="lanes")
    gait = jb.find_gait(
        jb.with_parameters(SCENE, {**values, "slope": 0.05}),
        footsteps=2,
        parameters=("J", "d"),
        accuracy="tight",
        radius_sensitivities=False,
        engine="lanes",
    )
    assert found.found
    np.testing.assert_array_equal(found.values, [gait.measures.step_length, gait.measures.period])
    for ours, slopes in (
        (found.slopes, gait.sensitivities),
        (found.slope_errors, gait.sensitivity_errors),
    ):
        np.testing.assert_array_equal(ours, np.stack([slopes.step_length, slopes.period]) * sizes)
    moved, along = found.state_at(np.array([0.5, 0.25])), np.array([0.5 * 0.02, 0.25 * 10.0])
    for ours, state, slope in zip(
        moved, gait.measures.state, gait.sensitivities.state, strict=True
    ):
        assert float(ours) == pytest.approx(float(state) + float(slope @ along), rel=1e-12)


def test_weights_are_those_of_every_number():
    angles = jb.identify.MeasuredAngles([0.0, 0.1], 0.005, theta_2=[0.2, 0.1])
    gait = dataclasses.replace(SEEN, angles=angles)
    np.testing.assert_allclose(gait.values, [0.5, 0.2, 0.35, 0.2, 0.1])
    np.testing.assert_allclose(gait.deviations, [0.01, 0.02, 0.03, 0.005, 0.005])

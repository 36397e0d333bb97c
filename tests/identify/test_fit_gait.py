"""Parameters found again, against those that the gaits were made from."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

import jaxbiped as jb
from jaxbiped.identify import FitEnding, MeasuredAngles, MeasuredGait

pytestmark = pytest.mark.slow

SLOPES = (0.01, 0.03)
RIGID = jb.ladder()["rigid"]
TRUTH = {name: float(jb.parameter_values(RIGID)[name]) for name in ("J", "d")}
J = TRUTH["J"]


@pytest.fixture(scope="module")
def gaits():
    return [
        jb.find_gait(jb.with_parameters(RIGID, {"slope": slope}), parameters=()) for slope in SLOPES
    ]


def _measured(gaits, noise=(0.0, 0.0), deviation=1e-4):
    found = []
    for slope, gait, off in zip(SLOPES, gaits, noise, strict=True):
        seen = {}
        for name in ("period", "step_length"):
            value = float(getattr(gait.measures, name))
            seen[name] = (value * (1.0 + deviation * off), value * deviation)
        found.append(MeasuredGait(seen, conditions={"slope": slope}))
    return found


@pytest.mark.parametrize("shares", [(1.25, 3.0), (0.5, 0.5), (0.5, 1.5), (1.5, 0.5), (1.5, 1.5)])
def test_the_truth_is_found_from_afar(gaits, shares):
    """From (0.5, 1.5) the start's own gait leads to others, which fit 1,000 deviations off."""
    start = {name: share * TRUTH[name] for name, share in zip(TRUTH, shares, strict=True)}
    fit = jb.fit_gait(jb.with_parameters(RIGID, start), ("J", "d"), _measured(gaits))
    assert fit.ending is FitEnding.CONVERGED
    assert fit.undetermined == ()
    assert fit.estimates == pytest.approx(TRUTH, rel=1e-6)
    assert fit.chi_squared < 1e-6
    assert fit.freedom == 2


def test_standard_errors_are_those_of_refitted_data(gaits):
    """The linear propagation of errors against a derivative of the estimates themselves."""
    fits = {
        noise: jb.fit_gait(RIGID, ("J",), _measured(gaits, noise=noise))
        for noise in ((0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.0, -0.1), (0.0, 0.0))
    }
    found, fit = [each.estimates["J"] for each in fits.values()], fits[0.0, 0.0]
    # Both measures of a gait were moved together: their parts of the estimate's error add up.
    together = [(found[0] - found[1]) / 0.2, (found[2] - found[3]) / 0.2]
    slopes = []
    for slope in SLOPES:
        gait = jb.find_gait(jb.with_parameters(RIGID, {"slope": slope}), parameters=("J",))
        for name in ("period", "step_length"):
            slopes.append(float(getattr(gait.elasticities, name)[0]) / 1e-4)
    slopes = np.array(slopes)
    weights = slopes / np.sum(slopes**2)
    expected = J * np.array([np.sum(weights[:2]), np.sum(weights[2:])])
    np.testing.assert_allclose(together, expected, rtol=1e-3)
    assert fit.standard_errors["J"] == pytest.approx(J / np.sqrt(np.sum(slopes**2)), rel=1e-4)
    low, high = fit.intervals["J"]
    assert low < J < high
    assert np.log(high / low) == pytest.approx(2 * 1.959964 * fit.standard_errors["J"] / J)


def test_what_the_data_cannot_tell_is_named(gaits):
    """Mass scales all forces alike: no time or length depends on it, J and m together apart."""
    fit = jb.fit_gait(RIGID, ("J", "m"), _measured(gaits))
    assert fit.undetermined == ("J", "m")  # only their ratio enters
    assert np.isnan(fit.standard_errors["J"])
    few = MeasuredGait({"period": (0.44, 1e-3)})
    assert jb.fit_gait(RIGID, ("d", "l"), few).undetermined == ("d", "l")


def test_angles_over_time(gaits):
    """The orbit's own angles give the parameter back, and bind it tighter than two measures do."""
    times, states = gaits[0].orbit
    chosen = np.flatnonzero(np.isfinite(np.asarray(times[0])))[2:-1:4]
    clock, *both = (np.asarray(x[0])[chosen] for x in (times, states.theta_1, states.theta_2))
    angles = MeasuredAngles(clock, 1e-4, *both)
    seen = MeasuredGait({}, conditions={"slope": SLOPES[0]}, angles=angles)
    fit = jb.fit_gait(jb.with_parameters(RIGID, {"J": 0.0085}), ("J",), seen)
    assert fit.ending is FitEnding.CONVERGED
    assert fit.estimates["J"] == pytest.approx(J, rel=1e-5)
    assert fit.standard_errors["J"] < 0.01 * J


@pytest.mark.parametrize("share", [0.5, 1.5])
def test_angles_are_fitted_from_half_as_much_off_on_whatever_clock(gaits, share):
    """From 30 ms after the strike on and through the next: SciPy's cubics of the orbit itself."""
    period, curves = _motion(gaits[0])
    times = np.linspace(0.0, 1.2, 25) * period
    both = [_leg(curves, period, leg, times + 0.03) for leg in (0, 1)]
    angles = MeasuredAngles(times, 1e-4, *both)
    seen = MeasuredGait({}, conditions={"slope": SLOPES[0]}, angles=angles)
    fit = jb.fit_gait(jb.with_parameters(RIGID, {"J": share * J}), ("J",), seen)
    assert fit.estimates["J"] == pytest.approx(J, rel=1e-4)
    assert fit.freedom == 48


def test_the_clock_reads_zero_at_mid_stance_of_every_model():
    """Against a root of the rigid walker's orbit, and the compliant cycle's beginning."""
    for scene, name in ((RIGID, "J"), (jb.seed_scene(), "d")):
        gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False)
        period, curves = _motion(gait)
        stands = curves[1]
        begin = brentq(stands, 0.1 * period, 0.9 * period) if stands(0.0) > 1e-6 else 0.0
        times = np.linspace(0.0, 0.95, 20) * period
        both = [_leg(curves, period, leg, times + begin) for leg in (0, 1)]
        angles = MeasuredAngles(times, 1e-4, *both, since="mid-stance")
        truth = float(jb.parameter_values(scene)[name])
        start = jb.with_parameters(scene, {name: 1.05 * truth})
        fit = jb.fit_gait(start, (name,), MeasuredGait({}, angles=angles), engine="lanes")
        assert fit.estimates[name] == pytest.approx(truth, rel=1e-4)
        assert fit.chi_squared < 0.1


def _motion(gait):
    """A footstep's duration, and both angles over it."""
    clock, states = np.asarray(gait.orbit[0][0]), gait.orbit[1]
    known = np.isfinite(clock)
    rows = [
        [np.asarray(getattr(states, f"{kind}_{leg}")[0])[known] for kind in ("theta", "omega")]
        for leg in (1, 2)
    ]
    return clock[known][-1], [CubicHermiteSpline(clock[known], *both) for both in rows]


def _leg(curves, period, leg, times):
    """One leg's angle: it takes the other's part in the next footstep."""
    own, other = curves[leg](times % period), curves[1 - leg](times % period)
    return np.where(times // period % 2 == 0, own, other)


def test_a_start_without_a_gait_is_told():
    steep = jb.with_parameters(RIGID, {"slope": 1.0})
    fit = jb.fit_gait(steep, ("J",), MeasuredGait({"period": (0.44, 1e-3)}))
    assert fit.ending is FitEnding.NO_GAIT
    assert np.isnan(fit.residuals).all()
    assert fit.undetermined == ("J",)


def test_bounds_are_kept(gaits):
    start = jb.with_parameters(RIGID, {"J": 1.2 * J})
    with pytest.warns(RuntimeWarning, match="does not fit"):
        fit = jb.fit_gait(start, {"J": (1.1 * J, 1.5 * J)}, _measured(gaits))
    assert fit.at_bounds == ("J",)
    assert fit.estimates["J"] == pytest.approx(1.1 * J, rel=1e-3)
    assert fit.estimates["J"] >= 1.1 * J


def test_a_parameter_that_is_zero_is_fitted_within_bounds():
    """Above zero by a twentieth of the bounds' width."""
    scene = jb.with_parameters(RIGID, {"hip_mass": 0.1})
    gait = jb.find_gait(scene, parameters=())
    value = float(gait.measures.period)
    start = jb.with_parameters(scene, {"hip_mass": 0.0})
    seen = MeasuredGait({"period": (value, 1e-4 * value)})
    fit = jb.fit_gait(start, {"hip_mass": (0.0, 2.0)}, seen)
    assert fit.ending is FitEnding.CONVERGED
    assert fit.estimates["hip_mass"] == pytest.approx(0.1, rel=1e-5)


def test_evaluations_are_limited(gaits):
    start = jb.with_parameters(RIGID, {"J": 0.013})
    fit = jb.fit_gait(start, ("J",), _measured(gaits), max_evaluations=2)
    assert fit.ending is FitEnding.OUT_OF_EVALUATIONS
    assert np.isfinite(fit.estimates["J"])


SEEN = MeasuredGait({"period": (0.44, 1e-3)}, conditions={"slope": 0.02})


@pytest.mark.parametrize(
    ("vary", "measured", "said"),
    [
        ((), SEEN, r"vary = \(\) is not allowed"),
        (("stiffness",), SEEN, "vary = 'stiffness' is not known: choose one of"),
        ({"J": (0.2, 0.1)}, SEEN, r"vary\['J'\] = \(0.2, 0.1\) is not allowed"),
        ({"J": (0.2, 0.3)}, SEEN, "does not hold the scene's own J = 0.0096"),
        ({"J": (-1.0, 0.3)}, SEEN, "J = -1"),
        (("hip_mass",), SEEN, "own hip_mass is 0 and gives no scale"),
        (("J",), [], r"measured = \[\] is not allowed"),
        (("slope",), SEEN, "slope is both known"),
        (("J",), MeasuredGait({"period": (1.0, 1.0)}, conditions={"m": -1.0}), "m = -1"),
    ],
)
def test_bad_arguments(vary, measured, said):
    with pytest.raises(jb.ArgumentError, match=said):
        jb.fit_gait(RIGID, vary, measured)


def test_compliant_parameters_are_found_and_xi_is_not():
    scene = jb.seed_scene()
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False)
    seen = {
        name: (float(getattr(gait.measures, name)), share * float(getattr(gait.measures, name)))
        for name, share in {"period": 1e-5, "step_length": 1e-4, "peak_normal": 1e-3}.items()
    }
    start = jb.with_parameters(scene, {"K": jnp.asarray(1.2e6), "c": jnp.asarray(0.9e7)})
    fit = jb.fit_gait(start, ("K", "c", "xi"), MeasuredGait(seen), engine="lanes")
    assert fit.ending is FitEnding.CONVERGED
    assert fit.undetermined == ("xi",)
    assert fit.estimates["K"] == pytest.approx(1e6, rel=1e-3)
    assert fit.estimates["c"] == pytest.approx(1e7, rel=1e-3)

"""Libraries of optimal gaits, against optima that are sought one by one."""

import warnings

import numpy as np
import pytest
import xarray

import jaxbiped as jb
from jaxbiped.optimise import Outcome
from tests.cli.commands import interrupt_after
from tests.optimise.test_costs_of_motion import START, compass

SEED = jb.ladder()["rigid"]
SPEED = {"vary": {"d": (0.05, 0.2)}, "maximise": "speed"}
GAINS = {"leg.hip.kp": (1.0, 200.0), "leg.hip.kd": (0.01, 20.0), "leg.hip.target": (0.05, 1.0)}
EFFORT = {"vary": GAINS, "minimise": "torque_squared", "guess": START}


@pytest.mark.slow
def test_each_gait_is_an_optimum_and_lost_ones_stop_no_others(tmp_path):
    """Of the seed on slopes between which one is too steep; saved and loaded."""
    slopes = [0.02, 0.022, 1.2, 0.024]
    gaits = jb.optimise.library(SEED, over={"slope": slopes}, **SPEED)
    assert gaits.outcome.values.tolist() == [0, 0, 7, 0]
    assert gaits.outcome.attrs["flag_meanings"].split()[7] == "lost"
    assert np.isnan(gaits.objective[2])
    assert np.isnan(gaits.state_theta_1[2])
    for place in (1, 3):
        own = jb.optimise_gait(jb.with_parameters(SEED, {"slope": slopes[place]}), **SPEED)
        point = gaits.isel(slope=place)
        assert own.outcome is Outcome.CONVERGED
        assert float(point.objective) == pytest.approx(own.objective, rel=1e-7)
        assert float(point.design_d) == pytest.approx(own.variables["d"], rel=1e-4)
        assert float(point.residual) < 1e-6 < float(point.curvature)
        slope = own.sensitivities.objective[own.sensitivities.parameters.index("slope")]
        assert float(point.slope_slope) == pytest.approx(slope, rel=1e-4)
        scene = jb.with_parameters(SEED, {"slope": slopes[place], "d": float(point.design_d)})
        state = own.gait.measures.state._replace(
            **{name[6:]: float(x) for name, x in point.items() if name.startswith("state_")}
        )
        gait = jb.find_gait(scene, state)
        assert float(gait.measures.speed) == pytest.approx(float(point.measure_speed), rel=1e-7)
    gaits.to_netcdf(tmp_path / "gaits.nc")
    assert xarray.open_dataset(tmp_path / "gaits.nc").equals(gaits)


@pytest.mark.slow
def test_parameters_that_do_not_go_together_are_lost_alone():
    """A foot's radius beyond the leg's length: of a point, and of designs on the way to one."""
    over = {"l": [0.4, 0.3], "r": [0.08, 0.35]}
    gaits = jb.optimise.library(SEED, over=over, vary={"d": (0.05, 0.2)}, maximise="speed")
    assert gaits.outcome.sel(l=0.3, r=0.35) == 7
    assert gaits.outcome.sel(r=0.08).values.tolist() == [0, 0]
    over = {"l": [0.4, 0.11], "slope": [0.02, 0.021]}
    gaits = jb.optimise.library(SEED, over=over, vary={"r": (0.06, 0.12)}, maximise="speed")
    assert gaits.outcome.values.tolist() == [[0, 0], [7, 7]]
    np.testing.assert_allclose(gaits.design_r[0], 0.12)


@pytest.mark.slow
def test_ctrl_c_keeps_the_points_that_are_done(monkeypatch):
    interrupt_after(monkeypatch, 1, "optima")
    gaits = jb.optimise.library(SEED, over={"slope": [0.02, 0.021, 0.022]}, **SPEED)
    assert gaits.outcome.values.tolist() == [0, 0, 8]


@pytest.mark.nightly
def test_a_grid_of_a_measure_and_a_parameter_has_tangents_of_the_objective():
    """The compass with a PD motor, by step length and gravity; slopes against the neighbours."""
    lengths, gravity = 0.4 + 0.001 * np.arange(5), [9.80, 9.81, 9.82]
    gaits = jb.optimise.library(
        compass(jb.actuation.PD(20.0, 1.0, 0.4)),
        over={"step_length": lengths, "g": gravity},
        subject_to="period==0.7",
        **EFFORT,
    )
    assert not np.any(gaits.outcome.values)
    assert float(gaits.objective[0, 1]) == pytest.approx(215.568557, rel=1e-8)
    np.testing.assert_allclose(gaits.measure_step_length.T, [lengths] * 3, rtol=1e-9)
    np.testing.assert_allclose(gaits.measure_period, 0.7, rtol=1e-9)
    assert float(gaits.residual.max()) < 2e-5
    values = gaits.objective.values
    across = (values[2:] - values[:-2]) / 0.002
    np.testing.assert_allclose(gaits.slope_step_length[1:-1], across, rtol=1e-4)
    along = (values[:, 2] - values[:, 0]) / 0.02
    np.testing.assert_allclose(gaits.slope_g[:, 1], along, rtol=3e-6)


@pytest.mark.slow
def test_a_requirement_that_begins_to_hold_is_met_on_the_way():
    """Slopes on which the fastest seed would make steps longer than allowed."""
    gaits = jb.optimise.library(
        SEED, over={"slope": np.linspace(0.02, 0.03, 6)}, subject_to="step_length<0.2", **SPEED
    )
    assert not np.any(gaits.outcome.values)
    free = jb.optimise.library(SEED, over={"slope": np.linspace(0.02, 0.03, 6)}, **SPEED)
    is_long = free.measure_step_length.values > 0.2
    assert 0 < np.sum(is_long) < 6
    np.testing.assert_allclose(gaits.measure_step_length[is_long], 0.2, rtol=1e-6)
    np.testing.assert_allclose(gaits.objective[~is_long], free.objective[~is_long], rtol=1e-7)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"over": {}}, "over = {} is not allowed"),
        ({"over": [0.02]}, "over"),
        ({"over": {"q": [1.0]}}, "over = 'q'"),
        ({"over": {"slope": []}}, "slope has values of shape"),
        ({"over": {"slope": [np.nan]}}, "slope"),
        ({"over": {"d": [0.1]}}, "vary has 'd' already"),
        ({"over": {"period": [0.7]}, "subject_to": "period<1"}, "subject_to has 'period' already"),
        ({"over": {"slope": [0.02]}, "scatter": {"slope": 0.1}}, "scatter is not an option"),
        ({"over": {"slope": [0.02]}, "maximise": "beauty"}, "maximise = 'beauty'"),
    ],
)
def test_bad_arguments_are_refused(options, sentence):
    with warnings.catch_warnings(), pytest.raises(jb.ArgumentError, match=sentence):
        jb.optimise.library(SEED, **SPEED | options)

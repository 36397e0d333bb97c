"""Tables of results, against the results."""

import csv
import io

import numpy as np
import pytest
import xarray as xr

import jaxbiped as jb
from jaxbiped.identify import FitEnding, GaitFit
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture(scope="module")
def gait():
    return jb.find_gait(simplest_walker(0.009), simplest_state(*STABLE))


def test_a_gait_is_one_row_with_its_errors(gait):
    (row,) = rows_of(gait.to_csv())
    measures, errors = gait.measures, gait.measure_errors
    for name, unit in (("period", "s"), ("speed", "m/s"), ("spectral_radius", "1")):
        assert float(row[f"{name} [{unit}]"]) == float(getattr(measures, name))
        assert float(row[f"{name}_error [{unit}]"]) == float(getattr(errors, name))
    assert float(row["state_theta_1 [rad]"]) == float(measures.state.theta_1)
    assert float(row["state_omega_2_error [rad/s]"]) == float(errors.state.omega_2)
    for k, value in enumerate(np.asarray(gait.multipliers)):
        read = complex(*(float(row[f"multiplier_{part}_{k + 1} [1]"]) for part in ("real", "imag")))
        assert read == value
    assert row["ending"] == "found"
    frame = gait.to_dataframe()
    assert frame.period.tolist() == [float(measures.period)]
    assert frame.attrs["units"]["period_error"] == "s"


def test_sensitivities_and_elasticities_have_rows_by_parameter(gait):
    frame = gait.to_dataframe(along="parameter").set_index("parameter")
    assert tuple(frame.index) == gait.parameters
    np.testing.assert_array_equal(frame.sensitivity_period, gait.sensitivities.period)
    np.testing.assert_array_equal(frame.sensitivity_period_error, gait.sensitivity_errors.period)
    np.testing.assert_array_equal(frame.elasticity_speed, gait.elasticities.speed)
    ratio = np.asarray(gait.elasticities.speed) / np.asarray(gait.sensitivities.speed)
    np.testing.assert_allclose(
        frame.elasticity_speed_error, np.asarray(gait.sensitivity_errors.speed) * np.abs(ratio)
    )
    assert frame.loc["slope", "parameter_unit"] == "rad"
    assert "multiplier_real" in gait.to_dataframe(along="multiplier")


def test_a_gait_in_a_file_is_the_same(gait, tmp_path):
    dataset = gait.to_dataset()
    dataset.to_netcdf(tmp_path / "gait.nc")
    with xr.open_dataset(tmp_path / "gait.nc") as read:
        assert read.period == dataset.period
        assert read.period.attrs["units"] == "s"
        assert read.period.attrs["ancillary_variables"] == "period_error"


def test_latex_has_the_value_and_its_bar(gait, tmp_path):
    text = gait.to_latex(tmp_path / "gait.tex", columns={"period": "$T$", "speed": "speed"})
    assert (tmp_path / "gait.tex").read_text() == text
    rows = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert len(rows) == 3
    name, value, unit = rows[1].removesuffix(r"\\").strip().split(" & ")
    assert (name, unit) == ("$T$", r"\unit{s}")
    shown, bar = value.rstrip(")").split("(")
    decimals = len(shown.partition(".")[2])
    assert abs(float(shown) - float(gait.measures.period)) <= 0.5 * 10.0**-decimals
    assert float(bar) == pytest.approx(
        float(gait.measure_errors.period) * 10.0**decimals, abs=0.5 + 1e-6
    )


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"along": "time"}, "along = 'time' is not known: choose one of"),
        ({"columns": ["periods"]}, "columns = 'periods' is not known: .* period"),
        ({"columns": "period"}, "give a list of names"),
        ({"path": "/no/such/folder/it.tex"}, "cannot be written"),
    ],
)
def test_what_is_not_allowed_is_one_sentence(gait, how, said):
    with pytest.raises(jb.ArgumentError, match=said):
        gait.to_latex(**how)


def fit():
    return GaitFit(
        ending=FitEnding.CONVERGED,
        estimates={"K": 2e6, "xi": 3.0, "c": 1e7},
        standard_errors={"K": 1e4, "xi": np.nan, "c": np.nan},
        intervals={"K": (1.9e6, 2.1e6), "xi": (np.nan, np.nan), "c": (2e6, np.inf)},
        correlation=np.where(np.arange(9).reshape(3, 3) == 0, 1.0, np.nan),
        undetermined=("xi",),
        at_bounds=(),
        residuals=np.array([0.1, -0.2]),
        freedom=1,
        evaluations=3,
        units={"K": "N/m^n", "xi": "", "c": "N s/m^2"},
        one_sided=("c",),
    )


def test_a_fit_has_rows_by_parameter():
    first, second, third = rows_of(fit().to_csv())
    assert first == {
        "parameter": "K", "unit": "N/m^n", "estimate [SI]": "2000000.0",
        "estimate_error [SI]": "10000.0", "low [SI]": "1900000.0", "high [SI]": "2100000.0",
        "undetermined": "no", "one_sided": "no", "at_bound": "no",
    }  # fmt: skip
    assert (second["estimate_error [SI]"], second["undetermined"]) == ("", "yes")
    assert (third["low [SI]"], third["high [SI]"], third["one_sided"]) == (
        "2000000.0",
        "inf",
        "yes",
    )
    assert fit().to_dataset().attrs["ending"] == "converged"
    rows = fit().to_latex(columns=["parameter", "estimate", "unit"]).splitlines()
    assert r"K & 2.000(10)e6 & \unit{N/m^n} \\" in rows
    assert r"xi & 3 &  \\" in rows


def test_a_fit_is_printed_in_a_line():
    assert repr(fit()) == (
        "GaitFit(converged, K=2e+06 ± 1e+04, xi=3 ± nan, c=1e+07 ± nan, chi squared 0.05 at 1 "
        "degrees of freedom, undetermined: xi, limited on one side: c, 3 scenes)"
    )


def test_the_units_of_sensitivities_are_words_in_latex(gait):
    table = gait.to_latex(along="parameter")
    assert "spectral radius (1 per unit of the parameter)" in table
    assert "per.unit" not in table


def test_footsteps_have_rows_and_none_has_a_header(seed_walk):
    scene, walk = seed_walk
    steps = jb.footsteps(scene, walk)
    frame = steps.to_dataframe()
    assert frame.attrs["units"]["max_penetration"] == "m"
    np.testing.assert_array_equal(frame.period, steps.period_s)
    np.testing.assert_array_equal(frame.leg, steps.leg)
    assert len(frame.columns) == 10
    none = jb.footsteps(scene, jb.simulate(scene, jb.seed_state(), duration=0.05))
    assert none.to_csv() == steps.to_csv().splitlines()[0] + "\n"


def test_rows_of_any_dataset_go_along_several_dimensions(seed_walk):
    dataset = jb.measure.trajectory_dataset(*seed_walk)
    rows = rows_of(jb.measure.to_csv(dataset, ("foot", "time")))
    assert len(rows) == dataset.sizes["foot"] * dataset.sizes["time"]
    assert [rows[0][name] for name in ("foot", "leg", "time [s]")] == ["1", "1", "0.0"]
    last = dataset.isel(foot=-1, time=-1)
    assert float(rows[-1]["normal_force [N]"]) == float(last.normal_force)
    assert float(rows[-1]["time [s]"]) == float(last.time)
    alone = jb.measure.to_dataframe(dataset, "time")
    np.testing.assert_array_equal(alone.theta_1, dataset.theta_1)
    assert "normal_force" not in alone


def test_dimensions_without_labels_have_a_column_for_each_place():
    metres, bars = {"units": "m"}, {"ancillary_variables": "pair_error"}
    pair, errors = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[0.1, 0.2], [0.3, 0.4]])
    dataset = xr.Dataset(
        {
            "pair": (("place", "part"), pair, metres | bars),
            "pair_error": (("place", "part"), errors, metres),
            "by_name": (("place", "named"), [[1.0], [2.0]]),
            "alone": ((), 5.0, {"units": ""}),
        },
        {"named": ["a"]},
    )
    assert jb.measure.to_csv(dataset, "place").splitlines() == [
        "pair_1 [m],pair_error_1 [m],pair_2 [m],pair_error_2 [m]",
        "1.0,0.1,2.0,0.2",
        "3.0,0.3,4.0,0.4",
    ]
    assert jb.measure.to_csv(dataset, "") == "alone [1]\n5.0\n"

"""What commands tell of gaits and walks, against numbers that are written down."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._files import strict_json
from jaxbiped.cli import _walk_report
from jaxbiped.cli._basin_starts import read_starts
from jaxbiped.cli._gait import _assumption_line, gait_numbers
from jaxbiped.cli._walk_report import footstep_rows
from jaxbiped.cli._walk_warnings import (
    cut_short,
    relative_residual,
    walk_warnings,
)
from jaxbiped.gait._homotopy import BranchEnd
from jaxbiped.gait._measures import Measures
from jaxbiped.measure._energy_ledger import EnergyLedger
from jaxbiped.measure._footsteps import Footsteps

SCENE = jb.seed_scene()
STATE = jb.State(*np.arange(8.0))


def gait(radius=0.5, found=jb.gait.Search.FOUND):
    measures = Measures(0.44, 0.18, 0.41, 160.0, radius, STATE)
    rows = Measures(*(np.array([10.0 + k, 20.0 + k]) for k in range(5)),
                    jb.State(*(np.array([k, -k]) * 1.0 for k in range(8))))  # fmt: skip
    return SimpleNamespace(
        outcome=found, measures=measures, residual=1e-9, multiplier_errors=np.array([0.01, np.nan]),
        multipliers=np.array([0.3 + 0.4j, np.nan]), unit_multiplier_error=2e-5,
        critical=jb.gait.Bifurcation.FOLD, parameters=("K", "slope"), sensitivities=rows,
        sensitivity_errors=rows, elasticities=rows, found_by="guess", others=(),
        origin=SimpleNamespace(branch_end=int(BranchEnd.REACHED)), walk_outcome=jb.Ending.WALKING,
        solver_steps=300, engine="lanes",
    )  # fmt: skip


def test_a_gaits_numbers_stand_under_their_names():
    numbers = json.loads(strict_json(gait_numbers(gait())))
    names = ("period_s", "step_length_m", "speed_m_s", "peak_normal_N", "spectral_radius")
    assert [numbers[name] for name in names] == [0.44, 0.18, 0.41, 160.0, 0.5]
    assert numbers["multipliers"] == [[0.3, 0.4], [None, None]]
    assert numbers["multiplier_errors"] == [0.01, None]
    assert (numbers["residual"], numbers["unit_multiplier_error"]) == (1e-9, 2e-5)
    assert numbers["bifurcation"] == "fold"
    assert numbers["state"] == STATE._asdict()
    for table in ("sensitivities", "sensitivity_errors", "elasticities"):
        assert [numbers[table]["K"][name] for name in names] == [10.0, 11.0, 12.0, 13.0, 14.0]
        assert numbers[table]["slope"]["speed_m_s"] == 22.0
        assert numbers[table]["slope"]["state.omega_2"] == -7.0


@pytest.mark.parametrize(
    ("radius", "found", "stable"),
    [
        (0.99, jb.gait.Search.FOUND, True),
        (1.01, jb.gait.Search.FOUND, False),
        (0.5, jb.gait.Search.NO_WALK, False),
    ],
)
def test_a_gait_is_stable_that_was_found_and_whose_radius_is_below_one(radius, found, stable):
    numbers = gait_numbers(gait(radius, found))
    assert numbers["stable"] is stable
    assert numbers["bifurcation"] == ("fold" if found is jb.gait.Search.FOUND else "none")


def test_what_a_rigid_gait_asks_of_feet_is_said():
    known = dict(needed_friction=0.25, impact_friction=0.5, least_normal_N=-1.0,
                 lowest_clearance_m=-0.002, lifting_m_s=-0.1)  # fmt: skip
    line = _assumption_line(known)
    for part in ("0.250 to roll", "0.500 at the impact", "would fly", "would be held", "-2.000 mm"):
        assert part in line
    other = _assumption_line(known | {"least_normal_N": 3.0, "lifting_m_s": 0.1})
    assert "stays down" in other
    assert "leaves the ground" in other


def test_the_cost_of_a_walk_is_over_all_its_footsteps(monkeypatch):
    found = SimpleNamespace(
        cost=np.zeros(2), motor_work=np.array([0.2, 0.3]), gravity_work=np.array([0.1, 0.05]),
        distance=np.array([0.2, 0.3]),
    )  # fmt: skip
    monkeypatch.setattr(jb.measure, "cost_of_transport", lambda *_: found)
    told = _walk_report.walk_cost(jb.with_parameters(SCENE, {"hip_mass": 0.5}), None)
    assert told["cost_of_transport"] == pytest.approx(0.65 / (2.5 * 9.8 * 0.5))
    assert told["motor_work_J"] == pytest.approx(0.5)
    assert f"{told['cost_of_transport']:.5f}" in _walk_report.cost_sentence(told)


def ledger(residual):
    parts = dict(gravity_work=2.0, damper_loss=1.0, friction_loss=0.5, stored_change=-0.25,
                 residual=residual, actuation_work=-0.25)  # fmt: skip
    return EnergyLedger(**{name: np.array([value]) for name, value in parts.items()})


def test_energy_left_open_is_told_as_a_share_of_what_was_turned_over():
    assert relative_residual(ledger(-0.04)) == pytest.approx(0.01)
    assert relative_residual(ledger(np.nan)) is None
    zero = EnergyLedger(*[np.zeros(1)] * 6)
    assert relative_residual(zero) is None


@pytest.mark.parametrize(
    ("share", "rtol", "warned"),
    [(2e-3, 1e-5, True), (5e-4, 1e-5, False), (5e-4, 1e-7, True), (2e-3, None, True)],
)
def test_a_walk_warns_of_energy_above_a_thousand_tolerances_or_a_thousandth(share, rtol, warned):
    numbers = dict(
        ending="walking", energy_residual_relative=share, energy_residual_J=share,
        solver={"accepted": 90, "rejected": 10},
    )  # fmt: skip
    found = walk_warnings(SCENE, numbers, rtol=rtol)
    assert any("the energy left open is" in sentence for sentence in found) is warned
    assert not any("cut short" in sentence for sentence in found)
    short = walk_warnings(SCENE, numbers | {"ending": "out of steps"}, rtol=rtol)
    assert any("cut short at 100 of" in sentence for sentence in short)
    assert cut_short("walking", 100) == []
    flight = walk_warnings(SCENE, numbers | {"ending": "airborne"}, rtol=rtol)
    assert "no foot touched the ground" in flight[0]


def test_what_overflowed_is_no_accurate_walk():
    """A ledger of nothing but overflow left no share to be compared with a bound."""
    numbers = dict(
        ending="fell forward", energy_residual_relative=None, energy_residual_J=np.nan,
        solver={"accepted": 10, "rejected": 5},
    )  # fmt: skip
    coarse, overflowed = walk_warnings(SCENE, numbers, rtol=10.0)
    assert "rtol = 10 is too coarse for v0" in coarse
    assert "is not a number" in overflowed
    settled = numbers | {"energy_residual_J": 0.0}
    assert walk_warnings(SCENE, settled, rtol=1e-6) == []
    grows = jb.with_parameters(SCENE, {"mu_kinetic": 0.6})
    (warning,) = walk_warnings(grows, settled, rtol=1e-6)
    assert "mu_kinetic = 0.6 is above mu_static = 0.5" in warning


def test_rows_of_a_table_of_footsteps_are_footsteps():
    fields = dataclasses.fields(Footsteps)
    steps = Footsteps(*[np.array([k, k + 0.5]) for k in range(len(fields))])
    rows = footstep_rows(steps)
    assert len(rows) == 2
    for name, value in rows[1].items():
        assert value == [field.name for field in fields].index(name) + 0.5


HEAD = "hip_x,hip_z,theta_1,theta_2,hip_vx,hip_vz,omega_1,omega_2"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has the header ''"),
        ("hip_x,hip_z\n1,2\n", "has the header 'hip_x,hip_z'"),
        (f"{HEAD}\n", "holds no starts"),
        (f"{HEAD}\n1,2,3,4,5,6,7,8\n1,2,3,4,5,6,7\n", "line 3: 7 numbers instead of 8"),
        (f"{HEAD}\n1,2,3,4,5,6,7,8,9\n", "line 2: 9 numbers instead of 8"),
        (f"{HEAD}\n1,2,3\n", "line 2: 3 numbers instead of 8"),
        (f"{HEAD}\n1,2,3,x,5,6,7,8\n", "line 2: '1,2,3,x,5,6,7,8' is not all numbers"),
    ],
)
def test_a_file_of_starts_that_is_none_is_refused_by_its_line(text, said, tmp_path):
    path = tmp_path / "starts.csv"
    path.write_text(text)
    with pytest.raises(jb.ArgumentError) as refused:
        read_starts(path, SCENE)
    assert said in str(refused.value)


def test_a_file_of_starts_is_read_column_by_column(tmp_path):
    path = tmp_path / "starts.csv"
    path.write_text(f"{HEAD}\n1,2,3,4,5,6,7,8\n\n11,12,13,14,15,16,17,18\n")
    found = read_starts(path, SCENE)
    np.testing.assert_array_equal(np.array(found), np.arange(1.0, 9.0)[:, None] + [0.0, 10.0])
    rigid = read_starts(path, jb.ladder()["rigid"])
    np.testing.assert_array_equal(rigid.theta_2, [4.0, 14.0])
    np.testing.assert_array_equal(rigid.omega_1, [7.0, 17.0])

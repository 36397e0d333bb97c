"""What commands tell of gaits and walks, against numbers that are written down."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.cli._gait import _assumption_line
from jaxbiped.cli._start_options import read_starts
from jaxbiped.cli._walk_report import walk_warnings

SCENE = jb.seed_scene()


def test_what_a_rigid_gait_asks_of_feet_is_said():
    known = dict(needed_friction=0.25, impact_friction=0.5, least_normal_N=-1.0,
                 lowest_clearance_m=-0.002, lifting_m_s=-0.1)  # fmt: skip
    line = _assumption_line(known)
    for part in ("0.250 to roll", "0.500 at the impact", "would fly", "would be held", "-2.000 mm"):
        assert part in line
    other = _assumption_line(known | {"least_normal_N": 3.0, "lifting_m_s": 0.1})
    assert "stays down" in other
    assert "leaves the ground" in other


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


HEAD = "hip_x,hip_z,theta_1,theta_2,hip_vx,hip_vz,omega_1,omega_2"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "it must have a header and at least one row"),
        ("hip_x;hip_z\n1;2\n", "line 1 has 1 cells, and the header 1: separate them by commas"),
        ("hip_x,hip_z\n1,2\n", "has the header 'hip_x,hip_z'"),
        (f"{HEAD}\n", "a header and at least one row"),
        (f"{HEAD}\n1,2,3,4,5,6,7,8\n1,2,3,4,5,6,7\n", "line 3 has 7 cells, and the header 8"),
        (f"{HEAD}\n1,2,3,4,5,6,7,8,9\n", "line 2 has 9 cells, and the header 8"),
        (f"{HEAD}\n1,2,3\n", "line 2 has 3 cells, and the header 8"),
        (f"{HEAD}\n\n1,2,3,x,5,6,7,8\n", "line 3: '1,2,3,x,5,6,7,8' is not all numbers"),
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
    rows = "1,2,3,4,5,6,7,8,,\r\n\r\n# more\r\n11,12,13,14,15,16,17,18,,\r\n,,,,,,,,,\r\n"
    path.write_text(f"\ufeff{HEAD},,\r\n{rows}", encoding="utf-8")  # as spreadsheets write it
    found = read_starts(path, SCENE)
    np.testing.assert_array_equal(np.array(found), np.arange(1.0, 9.0)[:, None] + [0.0, 10.0])
    rigid = read_starts(path, jb.ladder()["rigid"])
    np.testing.assert_array_equal(rigid.theta_2, [4.0, 14.0])
    np.testing.assert_array_equal(rigid.omega_1, [7.0, 17.0])

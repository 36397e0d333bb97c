"""Measured gaits from CSV, against the same ones written in code in SI units."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.identify import MeasuredAngles, read_measured

SCENE = jb.ladder()["rigid"]


def read(tmp_path, text, scene=SCENE):
    path = tmp_path / "measured.CSV"
    path.write_text("\ufeff" + text, encoding="utf-8")
    return read_measured(path, scene)


def test_units_are_made_si(tmp_path):
    first, second = read(
        tmp_path,
        """# on the treadmill
slope [deg],period (ms),period_error [ms], step_length [cm],step_length_error [mm],footsteps
1.5,441.5,1,18,2,1

2.0,430,1,,,
""",
    )
    measures = {"period": (0.4415, 1e-3), "step_length": (0.18, 2e-3)}
    assert first.measures == {name: pytest.approx(pair) for name, pair in measures.items()}
    assert first.conditions == {"slope": pytest.approx(np.deg2rad(1.5))}
    assert first.footsteps == 1
    assert second.measures == {"period": pytest.approx((0.43, 1e-3))}
    assert second.footsteps is None


def test_angles_have_rows_for_their_times(tmp_path):
    head = "gait,time [ms],theta_1 [deg],theta_2 [rad],angle_error [mrad],since,slope [rad]"
    gaits = read(
        tmp_path,
        f"""{head},speed [km/h],speed_error [m/s]
fast,0,-14,0.2,2,mid-stance,0.02,1.8,0.01
fast,100,,0.1,,,,,
slow,0,1,0.3,2,,0.01,,
""",
    )
    angles = MeasuredAngles(
        times=[0.0, 0.1], deviation=2e-3, since="mid-stance",
        theta_1=np.ma.array([np.deg2rad(-14.0), 0.0], mask=[False, True]), theta_2=[0.2, 0.1],
    )  # fmt: skip
    fast, slow = gaits
    np.testing.assert_allclose(fast.angles.values, angles.values)
    assert fast.angles.since == "mid-stance"
    assert fast.angles.deviation == pytest.approx(2e-3)
    assert fast.measures == {"speed": pytest.approx((0.5, 0.01))}
    assert fast.conditions == {"slope": 0.02}
    assert slow.angles.since is None
    assert slow.clocks == 1
    assert slow.measures == {}


def test_the_units_of_conditions_are_those_of_the_scene(tmp_path):
    text = "{} [{}],period [s],period_error [s]\n2,0.44,0.001\n"
    (gait,) = read(tmp_path, text.format("m", "g"))
    assert gait.conditions == {"m": 0.002}
    (gait,) = read(tmp_path, text.format("anything", "V/m"), scene=None)
    assert gait.conditions == {"anything": 2.0}
    with pytest.raises(jb.ArgumentError, match="its unit must be one of kg, g"):
        read(tmp_path, text.format("m", "m"))
    with pytest.raises(jb.ArgumentError, match=r"its unit must be one of kg m\^2"):
        read(tmp_path, text.format("J", "kg"))


def test_a_table_of_footsteps_is_read_back(tmp_path):
    """As `Footsteps.to_csv` writes numbers: all their digits."""
    measured = 0.1 + 0.2, 1e-3 / 3.0
    text = f"period [s],period_error [s]\n{measured[0]},{measured[1]}\n"
    (gait,) = read(tmp_path, text)
    assert gait.measures == {"period": measured}


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_what_spreadsheets_add_is_left_out(tmp_path, end):
    """Rows and columns of empty cells, spaces, quotes, and lines with a comment."""
    lines = [
        "slope [deg],, period [s] ,period_error [s],,", "# first,run", '1.5,,"0.44", 0.001 ,,',
        ",,,,,", "", "2,,0.43,0.001,,", ",,,,,", " , ,,,,", "",
    ]  # fmt: skip
    first, second = read(tmp_path, end.join(lines))
    assert first.measures == {"period": (0.44, 0.001)}
    assert second.measures == {"period": (0.43, 0.001)}
    assert second.conditions == {"slope": pytest.approx(np.deg2rad(2.0))}


HEAD = "period [s],period_error [s]"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "a header and at least one row"),
        (HEAD, "a header and at least one row"),
        ("period,period_error [s]\n1,2", r"'period' names no unit: write it as 'period \[s\]'"),
        ("period [m],period_error [s]\n1,2", r"'period \[m\]' is not allowed: .* one of s, ms"),
        ("period [s]\n1", r"no standard deviation: give it in a column 'period_error \[s\]'"),
        (f"{HEAD}\n1", "line 2 has 1 cells, and the header 2"),
        (f"#\n{HEAD}\n\n1;2", "line 4 has 1 cells"),
        (
            "period [s];period_error [s]\n0,44;0,001",
            "line 1 has 1 cells.*: separate them by commas, .* point",
        ),
        ("#\nperiod [s]\tperiod_error [s]\n1\t2", "line 2 has 1 cells"),
        (f"{HEAD}\n0,44,0,001", "line 2 has 4 cells, and the header 2: .* with a point"),
        (f"{HEAD},\n1,1,3", "line 2 has 3 cells"),
        (f"{HEAD},slope [deg]\n1,1,1\n,,2", "line 3: measures = {} is not allowed"),
        (f"{HEAD}\nfast,1", r"line 2: period \[s\] = 'fast' is not allowed: it must be a number"),
        (f"{HEAD},K [N/m]\n1,1,1", "a column = 'K' is not known: .*theta_BODY, m, J"),
        (f"{HEAD},{HEAD}\n1,1,1,1", "the column 'period' is there 2 times"),
        ("time [s],theta_1 [deg]\n1,2", "angles need the columns"),
        (f"{HEAD},slope [m]\n1,1,1", "must be one of rad, mrad, deg"),
        (f"gait,{HEAD}\na,1,1\na,2,1", "period is 1.0 and 2.0 in rows of one gait"),
        (f"{HEAD}\n0.4,-1", "the standard deviation of period"),
    ],
)
def test_what_is_not_allowed_is_one_sentence(tmp_path, text, said):
    with pytest.raises(jb.ArgumentError, match=said):
        read(tmp_path, text)

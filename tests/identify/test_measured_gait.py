"""Measured gaits, against the file that they are read from."""

import json

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.identify import MeasuredAngles, MeasuredGait, read_measured

GAIT = {
    "conditions": {"slope": 0.02},
    "period_s": [0.441, 0.001],
    "peak_normal_N": [310.0, 5.0],
    "angles": {"times_s": [0.0, 0.1], "theta_1_rad": [0.1, 0.2], "deviation_rad": 0.01},
}


def _written(tmp_path, held):
    path = tmp_path / "measured.json"
    path.write_text(held if isinstance(held, str) else json.dumps(held))
    return path


def test_a_file_gives_its_gaits(tmp_path):
    (gait,) = read_measured(_written(tmp_path, {"gaits": [GAIT]}))
    assert gait.conditions == {"slope": 0.02}
    assert gait.measures == {"period": (0.441, 0.001), "peak_normal": (310.0, 5.0)}
    np.testing.assert_array_equal(gait.values, [0.441, 310.0, 0.1, 0.2])
    np.testing.assert_array_equal(gait.deviations, [0.001, 5.0, 0.01, 0.01])


@pytest.mark.parametrize(
    ("held", "said"),
    [
        ("{", "is not JSON"),
        ({}, "it must hold"),
        ({"gaits": []}, "at least one"),
        ({"gaits": [{"period": [1.0, 0.1]}]}, "'period' is not known in a gait"),
        ({"gaits": [{"angles": {"time": []}}]}, "'time' is not known in angles"),
        ({"gaits": [{"period_s": 1.0}]}, "give the value and its standard deviation"),
        ({"gaits": [{"period_s": [1.0, 0.0]}]}, "standard deviation of period = 0"),
        ({"gaits": [{"conditions": 3}]}, "conditions = 3 is not allowed"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path, held, said):
    with pytest.raises(jb.ArgumentError, match=said):
        read_measured(_written(tmp_path, held))


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(jb.ArgumentError, match="cannot be read"):
        read_measured(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: MeasuredGait({}), "give a measure or angles"),
        (lambda: MeasuredGait({"speed": (np.nan, 1.0)}), "a finite number"),
        (lambda: MeasuredGait({"height": (1.0, 1.0)}), "'height' is not known"),
        (lambda: MeasuredGait({"speed": (1.0, 1.0)}, footsteps=0), "footsteps = 0"),
        (lambda: MeasuredAngles([0.1], 0.1), "give one of them"),
        (lambda: MeasuredAngles([0.1], 0.1, [0.1, 0.2]), "theta_1 has the shape"),
        (lambda: MeasuredAngles([-0.1], 0.1, [0.1]), "times = -0.1"),
        (lambda: MeasuredAngles([0.1], 0.1, [12.0]), "are these degrees"),
        (lambda: MeasuredAngles([441.0], 0.1, [0.1]), "are these milliseconds"),
        (lambda: MeasuredGait({"period": (441.0, 1.0)}), "are these milliseconds"),
        (lambda: MeasuredAngles([0.1], 0.1, [0.1], since="noon"), "since = 'noon'"),
        (lambda: MeasuredAngles([0.1], 0.1, np.ma.array([0.1], mask=True)), "no angle"),
        (lambda: MeasuredGait({"period": np.ma.array([1.0, 0.1], mask=True)}), "give a measure"),
    ],
)
def test_what_cannot_be_measured_is_refused(make, said):
    with pytest.raises(jb.ArgumentError, match=said):
        make()


def test_masked_entries_are_missing(tmp_path):
    """As if they had not been there: in times, angles, measures, and as null in a file."""
    times = np.ma.array([0.0, 0.1, -9.0, 0.3], mask=[False, False, True, False])
    theta_1 = np.ma.array([0.1, -9999.0, 0.3, 0.4], mask=[False, True, False, False])
    angles = MeasuredAngles(times, 0.01, theta_1, [0.5, 0.6, 0.7, 0.8])
    np.testing.assert_array_equal(angles.values, [0.1, 0.4, 0.5, 0.6, 0.8])
    gait = MeasuredGait({"period": (np.ma.masked, 0.1), "speed": (0.4, 0.1)}, angles=angles)
    np.testing.assert_array_equal(gait.values, [0.4, 0.1, 0.4, 0.5, 0.6, 0.8])
    assert len(gait.deviations) == 6
    held = GAIT["angles"] | {"theta_1_rad": [None, 0.2], "since": "mid-stance"}
    (read,) = read_measured(_written(tmp_path, {"gaits": [GAIT | {"angles": held}]}))
    np.testing.assert_array_equal(read.angles.values, [0.2])
    assert (gait.clocks, read.clocks) == (1, 0)

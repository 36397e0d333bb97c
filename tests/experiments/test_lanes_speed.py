"""Speed of both engines, at its quick size, against results that must be right."""

import pytest

from tests.drawn import assert_is_drawn, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_what_is_timed_is_right(tmp_path):
    numbers, figures = quick_run("lanes_speed", tmp_path, alone=True)
    ways = {row["way"] for row in numbers["singles"]}
    assert {"lanes", "lanes, rodas4", "xla"} <= ways
    assert all(row["error"] < 1e-3 for row in numbers["singles"])
    assert numbers["batches"]
    assert all(row["error_median"] < 1e-3 for row in numbers["batches"])
    assert "lanes" in {row["way"] for row in numbers["derivatives"]}
    ours = [row for row in numbers["derivatives"] if row["way"] != "CasADi CVODES"]
    assert all(0.0 < row["error"] < 1e-4 for row in ours)
    gaits = {"lanes, with the radius's", "lanes, without the radius's"}
    assert set(numbers["gaits_s"]) == set(numbers["gait_periods_s"]) == gaits
    for period in numbers["gait_periods_s"].values():
        assert period == pytest.approx(0.4408349, abs=1e-7)
    more, less = numbers["scenes"]
    assert more["instructions"] > less["instructions"] > 0
    assert 0.0 < numbers["share_of_peak"] < 1.0
    (figure,) = figures.values()
    counts = {"simulations in the batch", "simulations of 2 s a second"}
    assert_is_drawn(figure, unitless=counts)
    batches, alone = figure.axes
    shown = points_of(batches, "lanes")[0][:, 1].tolist()
    rows = [row for row in numbers["batches"] if row["way"] == "lanes"]
    assert shown == [row["simulations_per_s"] for row in rows]
    assert {line.get_label() for line in alone.lines} == ways

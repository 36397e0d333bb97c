"""Reproducibility, at its quick size, against bits and a start one ulp away."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_lanes_give_the_same_bits_and_xla_what_an_ulp_does(tmp_path):
    numbers, figures = quick_run("reproducibility", tmp_path)
    assert_is_drawn(figures["reproducibility.png"], unitless={"share of walks that differ by more"})
    rows = {row["name"]: row for row in numbers["rows"]}
    moved = rows.pop("lanes, start one ulp away")
    xla = rows.pop("XLA")
    assert {"lanes, 256 bits, threads: 1", "lanes, batches of 7"} <= rows.keys()
    for row in rows.values():
        assert row["same_bits"] == numbers["walks"], row["name"]
        assert row["labels"] == row["gait"] == 0
    assert moved["same_bits"] == 0
    assert 0.0 < xla["median"] < 3.0 * moved["median"]
    assert xla["endings"] == 0

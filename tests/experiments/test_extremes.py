"""Extremes, at the quick size, against the check's own precise solves."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_nothing_is_silently_wrong(tmp_path):
    numbers, figures = quick_run("extremes", tmp_path)
    assert_is_drawn(figures["extremes.png"], unitless={"cases"})
    assert numbers["run"] == numbers["catalogue"] >= 60
    assert numbers["silently_wrong"] == numbers["gaits"]["silently_wrong"] == 0
    assert numbers["accurate"] > 0.7 * numbers["run"]
    assert numbers["gaits"]["compared"] >= 2
    for graze, least in zip(numbers["grazing"], (4, 8), strict=True):
        assert graze["derivatives"] == 8
        assert graze["accurate"] >= least
        assert graze["silently_wrong"] == 0

"""Walks on other vectors, at the experiment's quick size."""

import pytest

from tests.experiments.quick import quick_run

pytestmark = pytest.mark.slow


def test_lanes_do_not_depend_on_their_batch(tmp_path):
    numbers, _ = quick_run("vector_widths", tmp_path)
    own = numbers["lanes"][0]["instructions"]
    for row in numbers["lanes"]:
        if row["instructions"] == own:
            assert row["identical"] == row["walks"]
        assert row["largest"] < 1e-4

"""Derivatives through endings and laws, at the quick size, against differences of finer walks."""

import pytest

from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_every_cell_is_right_or_refused(tmp_path):
    numbers, _ = quick_run("event_derivatives", tmp_path)
    assert len(numbers["endings"]) == 5
    for row in numbers["endings"]:
        for error in row["errors"].values():
            if row["ends"] == "every step":
                assert 'save="steps"' in error
            else:
                assert error < 1e-4
    for errors in numbers["laws"]["stribeck"].values():
        draft, balanced, tight = errors
        assert draft < 1e-3
        assert balanced < 1e-4
        assert tight < 1e-5
    table = (tmp_path / "event_derivatives.md").read_text()
    assert "kelvin-voigt" in table

"""Methods, at the quick size, against each other's steps at equal error."""

import pytest

from tests.drawn import assert_is_drawn, labels_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_the_default_has_the_smaller_error_in_about_as_many_steps(tmp_path):
    numbers, figures = quick_run("steps_tried", tmp_path, alone=True)
    old, new = ({row["way"]: row for row in numbers["rows"]}[way] for way in ("rodas4", "rodas4p"))
    assert new["error_median"] < old["error_median"] < 1e-4
    assert new["steps"] < 1.1 * old["steps"]
    assert 0.0 < new["rejected"] < 0.3
    (figure,) = figures.values()
    assert labels_of(figure) >= {"median error of the final state (SI units)"}
    assert_is_drawn(figure, unitless={"median error of the final state (SI units)"})

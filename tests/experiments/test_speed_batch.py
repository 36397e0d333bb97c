"""Speed of batches, at its quick size, against every lane's arrival."""

import pytest

from tests.drawn import assert_is_drawn, labels_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_every_lane_arrives(tmp_path):
    numbers, figures = quick_run("speed_batch", tmp_path, alone=True)
    ours = [row for row in numbers["rows"] if row["way"] == "vmap"]
    assert ours
    assert all(row["failed"] == 0 and row["steps_per_second"] > 0 for row in ours)
    (figure,) = figures.values()
    labels = {"simulations in the batch", "attempted steps a second, all lanes"}
    assert labels_of(figure) == labels
    assert_is_drawn(figure, unitless=labels)

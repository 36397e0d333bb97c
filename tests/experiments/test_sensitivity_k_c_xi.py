"""Sensitivity to K, c and xi, at its quick size, against the seed's elasticities."""

import pytest

from tests.drawn import assert_is_drawn, labels_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_every_gait_is_found_with_its_elasticities(tmp_path):
    numbers, figures = quick_run("sensitivity_K_c_xi", tmp_path)
    (figure,) = figures.values()
    elasticities = {label for label in labels_of(figure) if label.startswith("elasticity of")}
    assert elasticities
    assert_is_drawn(figure, unitless=elasticities)
    assert numbers["without_a_gait"] == []
    points = {name: row[len(row) // 2] for name, row in numbers["points"].items()}
    for seed in points.values():
        assert seed["measures"]["period"] == pytest.approx(0.440835, abs=1e-6)
        assert seed["elasticities"]["peak_normal"][:2] == pytest.approx([0.139, 0.479], abs=1e-3)
    for row in numbers["points"].values():
        assert all(max(point["errors"]["period"]) < 1e-4 for point in row)

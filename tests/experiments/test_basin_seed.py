"""The seed's basin, at its quick size, against Wilson's intervals and two kinds of normals."""

import numpy as np
import pytest

from tests.drawn import assert_is_drawn, labels_of, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_the_seeds_basin(tmp_path):
    numbers, figures = quick_run("basin_seed", tmp_path)
    assert set(figures) == {"basin_seed.png", "basin_seed_refined.png", "basin_seed_along.png"}
    for figure in figures.values():
        assert_is_drawn(figure, unitless={"fraction of the starts"})
    plane, refined = (figures[f"basin_seed{end}.png"] for end in ("", "_refined"))
    assert len(labels_of(plane)) == 2
    assert labels_of(plane) == labels_of(refined)
    walks = points_of(figures["basin_seed_along.png"].axes[0], "walking period-1")[0][:, 1]
    np.testing.assert_allclose(walks, [row[0] for row in numbers["along"]["c"]["walking"]])
    fractions = numbers["fractions"]
    assert sum(part["estimate"] for part in fractions.values()) == pytest.approx(1.0)
    walking = fractions["walking period-1"]
    assert walking["low"] < numbers["refined"]["walking"] < walking["high"]
    # Whether it walks is parted by a curve that is less folded than which failure comes.
    folds = {name: each["dimension"] for name, each in numbers["boundary"].items()}
    assert 1.0 < folds["walking or not"] < folds["all labels"] < 2.0
    # What a tolerance changes, it changes beside boundaries.
    for row in numbers["tolerances"]:
        assert row["changed"] < 0.02
        assert row["changed_beside_boundary"] in (None, pytest.approx(1.0, abs=0.2))
    # Rays turned to the boundary's normal find a smaller push, by either kind of normal.
    rays, secants, gradients = numbers["pushes"]
    assert gradients["distance"] < rays["distance"]
    assert gradients["distance"] == pytest.approx(secants["distance"], rel=1e-3)
    assert gradients["asked"] < secants["asked"]
    assert gradients["angle"] < 0.01
    # Damping shrinks the basin.
    low, _, high = numbers["along"]["c"]["walking"]
    assert low[0] > high[0]

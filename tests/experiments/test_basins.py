"""Basins, at their quick size, against Wilson's intervals and published equations."""

import numpy as np
import pytest

from tests.drawn import labels_of, points_of
from tests.experiments.quick import drawn_run

pytestmark = pytest.mark.nightly


def test_the_seeds_basin(tmp_path):
    numbers, figures = drawn_run("basin_seed", tmp_path, unitless={"fraction of the starts"})
    assert set(figures) == {"basin_seed.png", "basin_seed_refined.png", "basin_seed_along.png"}
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


def test_the_simplest_walkers_basin_is_thin_and_as_the_equations_say(tmp_path):
    numbers, figures = drawn_run("basin_simplest", tmp_path)
    (figure,) = figures.values()
    assert len(figure.axes) >= 2 * len(numbers["slopes"]) == 4
    for found in numbers["slopes"].values():
        assert found["gait_off"] < 1e-6
        assert found["intervals_overlap"]
        assert all(0.0 < row["estimate"] < 0.01 for row in found["fractions"])
        assert all(1e-3 < each["distance"] < 1e-2 for each in found["reach"].values())
        assert found["check"]["disagree"] == 0
        assert 0 < found["check"]["walking"] < found["check"]["starts"]

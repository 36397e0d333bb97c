import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow


def test_the_simplest_walkers_basin_is_thin_and_as_the_equations_say(tmp_path):
    numbers = quick_numbers(
        "basin_simplest", tmp_path, keys={"slopes", "picture"}, pictures={"basin_simplest.png"}
    )
    for found in numbers["slopes"].values():
        assert found["gait_off"] < 1e-6
        assert found["intervals_overlap"]
        assert all(0.0 < row["estimate"] < 0.01 for row in found["fractions"])
        assert all(1e-3 < each["distance"] < 1e-2 for each in found["reach"].values())
        assert found["check"]["disagree"] == 0
        assert 0 < found["check"]["walking"] < found["check"]["starts"]

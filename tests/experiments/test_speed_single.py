import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow


def test_agrees_with_an_independent_solve(tmp_path):
    numbers = quick_numbers(
        "speed_single",
        tmp_path,
        keys={"first_compile_s", "at_equal_error", "points", "reference_difference"},
        pictures={"speed_single.png"},
    )
    assert numbers["reference_difference"] < 1e-8
    assert min(point["error"] for point in numbers["points"]["rodas4"]) < 1e-7

import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow


def test_rungs_and_the_way_to_the_rigid_limit(tmp_path):
    numbers = quick_numbers(
        "ladder",
        tmp_path,
        keys={"measures", "costs", "distance_from_rung_above", "paths", "equal_errors"},
        pictures={"ladder.png", "rigid_limit.png"},
    )
    measures = numbers["measures"]
    assert measures["rigid"]["period"] == pytest.approx(0.44378, abs=5e-6)
    assert measures["stribeck"]["period"] == pytest.approx(0.440835, abs=2e-6)
    assert numbers["costs"]["rigid"]["error"] <= numbers["costs"]["stribeck"]["error"]
    # Stiffness alone leads past the rigid gait; damping leads towards it.
    stiff, damped = numbers["paths"]["K alone"], numbers["paths"]["c alone"]
    assert stiff["period"][-1] > 0.0 > stiff["period"][0]
    assert damped["step_length"] == sorted(damped["step_length"])
    assert damped["step_length"][-1] < 0.0

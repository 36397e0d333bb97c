import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow

FIGURES = {
    "fig4_strobe",
    "fig5_phase_portrait",
    "fig6_leg_angles",
    "fig7_penetrations",
    "fig8_contact_forces",
}


def test_walks_as_the_paper_says(tmp_path):
    numbers = quick_numbers(
        "paper_figures_4_8",
        tmp_path,
        keys={"outcome", *FIGURES},
        pictures={"walk.gif", *(f"{figure}.png" for figure in FIGURES)},
    )
    assert numbers["outcome"] == "walking"
    assert max(numbers["fig8_contact_forces"]["peak_normal_N"]) == pytest.approx(312.6, rel=0.01)
    assert max(numbers["fig7_penetrations"]["largest_m"]) == pytest.approx(0.702e-3, rel=0.01)
    assert numbers["fig6_leg_angles"]["angle_range_leg_1_rad"] == pytest.approx(
        [-0.2479, 0.2824], abs=1e-3
    )

"""The paper's figures 4 to 8, at the quick size, against published numbers."""

import pytest
from PIL import Image

from tests.drawn import assert_is_drawn, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly

FIGURES = {
    "fig4_strobe",
    "fig5_phase_portrait",
    "fig6_leg_angles",
    "fig7_penetrations",
    "fig8_contact_forces",
}


def test_walks_as_the_paper_says(tmp_path):
    numbers, figures = quick_run("paper_figures_4_8", tmp_path)
    assert set(figures) == {f"{figure}.png" for figure in FIGURES}
    for figure in figures.values():
        assert_is_drawn(figure)
    with Image.open(tmp_path / "walk.gif") as moving:
        assert moving.n_frames > 1
    angles = points_of(figures["fig6_leg_angles.png"].axes[0], "leg 1")[0][:, 1]
    assert [angles.min(), angles.max()] == pytest.approx(
        numbers["fig6_leg_angles"]["angle_range_leg_1_rad"], abs=1e-4
    )
    assert numbers["outcome"] == "walking"
    assert max(numbers["fig8_contact_forces"]["peak_normal_N"]) == pytest.approx(312.6, rel=0.01)
    assert max(numbers["fig7_penetrations"]["largest_m"]) == pytest.approx(0.702e-3, rel=0.01)
    assert numbers["fig6_leg_angles"]["angle_range_leg_1_rad"] == pytest.approx(
        [-0.2479, 0.2824], abs=1e-3
    )

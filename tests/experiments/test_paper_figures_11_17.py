import pytest

from tests.drawn import assert_is_drawn, labels_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.slow

FIGURES = {
    "fig11_violation",
    "fig12_all_methods",
    "fig13_without_standard",
    "fig14_time_ratio",
    "fig15_augmented",
    "fig16_standard",
    "fig17_times",
}


def test_judges_the_papers_sentences(tmp_path):
    numbers, figures = quick_run("paper_figures_11_17", tmp_path)
    assert set(figures) == {f"{figure}.png" for figure in FIGURES}
    for name, figure in figures.items():
        assert_is_drawn(figure)
        # Violations in metres over seconds, or times.
        assert any("(s)" in label or "(ms)" in label for label in labels_of(figure)) or (
            name == "fig14_time_ratio.png"
        )
    methods = numbers["methods"]
    assert methods["described"]["max_violation_m"] < 1e-14
    assert methods["standard"]["last_half_m"] > 1.5 * methods["standard"]["first_half_m"]
    assert methods["augmented"]["max_violation_m"] < methods["standard"]["max_violation_m"]
    integrators = numbers["integrators"]
    runge, euler = (integrators[f"augmented {name}"] for name in ("runge2", "euler"))
    assert runge["max_violation_m"] < 0.1 * euler["max_violation_m"]
    said = {each["sentence"]: each["confirmed"] for each in numbers["verdicts"]}
    assert len(said) >= 6
    assert said["the method that most eliminates the constraints violations is the Runge-Kutta"]
    assert set(numbers["costs"]) == {"minimal", "standard", "described"}
    for key in ("single", "batch"):
        assert numbers["costs"]["standard"][key] == 1.0
        assert all(each[key] > 0.0 for each in numbers["costs"].values())

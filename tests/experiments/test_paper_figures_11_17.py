"""The paper's figures 11 to 17, at the quick size, against what the paper says."""

import pytest

from tests.drawn import assert_is_drawn, labels_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly

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
        names, values = {"time (s)"}, {"violation (m)"}
        if name == "fig14_time_ratio.png":
            names, values = {"method"}, {"time by Euler steps, standard = 1"}
        elif name == "fig17_times.png":
            names, values = {"integrator"}, {"time of a run (s)"}
        assert labels_of(figure) == names | values, name
        assert_is_drawn(figure, unitless={"method", "integrator", *values})
    bars = [bar.get_height() for bar in figures["fig14_time_ratio.png"].axes[0].patches]
    shown = [numbers["costs"][name] for name in numbers["costs"] if name != "minimal"]
    assert bars == [row[key] for key in ("single", "batch") for row in shown]
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

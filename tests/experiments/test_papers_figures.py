"""The paper's figures and the hip's constraints, at the quick size, against what the paper says."""

import numpy as np
import pytest
from PIL import Image

from tests.drawn import assert_is_drawn, labels_of, points_of
from tests.experiments.quick import drawn_run, quick_run

pytestmark = pytest.mark.nightly

WALK = ("fig4_strobe", "fig5_phase_portrait", "fig6_leg_angles", "fig7_penetrations",
        "fig8_contact_forces")  # fmt: skip
HIP = ("fig11_violation", "fig12_all_methods", "fig13_without_standard", "fig14_time_ratio",
       "fig15_augmented", "fig16_standard", "fig17_times")  # fmt: skip


def test_walks_as_the_paper_says(tmp_path):
    numbers, figures = drawn_run("paper_figures_4_8", tmp_path)
    assert set(figures) == {f"{figure}.png" for figure in WALK}
    with Image.open(tmp_path / "walk.gif") as moving:
        assert moving.n_frames > 1
    angles = points_of(figures["fig6_leg_angles.png"].axes[0], "leg 1")[0][:, 1]
    told = numbers["fig6_leg_angles"]["angle_range_leg_1_rad"]
    assert [angles.min(), angles.max()] == pytest.approx(told, abs=1e-4)
    assert told == pytest.approx([-0.2479, 0.2824], abs=1e-3)
    assert numbers["outcome"] == "walking"
    assert max(numbers["fig8_contact_forces"]["peak_normal_N"]) == pytest.approx(312.6, rel=0.01)
    assert max(numbers["fig7_penetrations"]["largest_m"]) == pytest.approx(0.702e-3, rel=0.01)


def test_judges_the_papers_sentences(tmp_path):
    numbers, figures = quick_run("paper_figures_11_17", tmp_path)
    assert set(figures) == {f"{figure}.png" for figure in HIP}
    own = {
        "fig14_time_ratio.png": ("method", "time by Euler steps, standard = 1"),
        "fig17_times.png": ("integrator", "time of a run (s)"),
    }
    for name, figure in figures.items():
        words = set(own.get(name, ("time (s)", "violation (m)")))
        assert labels_of(figure) == words, name
        assert_is_drawn(figure, unitless=words)
    bars = [bar.get_height() for bar in figures["fig14_time_ratio.png"].axes[0].patches]
    costs = numbers["costs"]
    shown = [costs[name] for name in costs if name != "minimal"]
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
    assert set(costs) == {"minimal", "standard", "described"}
    for key in ("single", "batch"):
        assert costs["standard"][key] == 1.0
        assert all(each[key] > 0.0 for each in costs.values())


def test_the_sketch_has_the_walker_where_the_model_has_it(tmp_path):
    numbers, figures = quick_run("walker_sketch", tmp_path)
    words = {text.get_text() for text in figures["walker_sketch.png"].axes[0].texts}
    named = ("alpha", "theta_1", "theta_2", "delta_2")
    assert {"$S$", "$l$", "$d$", "$r$", "$x$", "$z$", "$g$"} <= words
    assert {rf"$\{name}$" for name in named} <= words
    hip, (swing, stance) = np.array(numbers["hip_m"]), np.array(numbers["foot_centres_m"])
    for foot, angle in ((swing, -0.62), (stance, 0.30)):
        down = np.array((np.sin(angle), -np.cos(angle)))
        np.testing.assert_allclose(foot, hip + (0.40 - 0.08) * down, rtol=0, atol=1e-12)
    assert swing[1] > 0.08
    np.testing.assert_allclose(stance[1], 0.08 - 0.022, rtol=0, atol=1e-12)


def test_errors_costs_and_maps_of_constraint_methods(tmp_path):
    numbers, figures = drawn_run("constraint_trade", tmp_path)
    trade, constants = figures["trade.png"], figures["constants.png"]
    assert labels_of(trade) == {"time of a run (s)", "error of the state (SI)"}
    assert {"a (1/s)", "b (1/s)"} <= labels_of(constants)
    runs = {(run["method"], run["rtol"] or run["dt_s"]): run for run in numbers["runs"]}
    for method in ("standard", "index1"):
        own = [run for run in numbers["runs"] if run["method"] == method]
        shown = [(run["wall_s_run"], run["state_error"]) for run in own]
        np.testing.assert_array_equal(points_of(trade.axes[0], method)[0], shown)
        coarse, fine = runs[method, 1e-5], runs[method, 1e-6]
        assert fine["state_error"] < 0.3 * coarse["state_error"]
        assert fine["steps"] == 10 * coarse["steps"]
    assert runs["index1", 1e-6]["max_violation_m"] < 1e-15
    costs = numbers["costs"]
    assert set(costs) == {"minimal", "standard", "index1"}
    for key in ("single", "batch"):
        usual = costs["standard"][f"{key}_s"]
        for each in costs.values():
            assert each[key] == each[f"{key}_s"] / usual > 0.0
    found = numbers["maps"]["baumgarte"]
    off = np.array(found["max_violation_m"], dtype=float)
    # Faster decay, smaller violation: along a = b, as far as Euler steps stand it.
    assert off[1, 1] < off[0, 0]
    # One that is pulled back faster than the steps are short, without damping, explodes.
    assert found["failed"][0][-1]

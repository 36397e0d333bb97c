"""Comparison of contact laws, at its quick size, against walks that settle."""

import pytest

from tests.drawn import assert_is_drawn, labels_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_laws_are_measured_and_judged(tmp_path):
    numbers, figures = quick_run("force_models", tmp_path)
    assert set(figures) == {
        "force_models_normal.png",
        "force_models_friction.png",
        "force_models_measures.png",
        "figure_9_leg_angle.png",
        "figure_10_contact_force.png",
    }
    for figure in figures.values():
        assert_is_drawn(figure)
    time = "time, $t$ (s)"
    angle, force = r"leg angle, $\theta$ (rad)", "normal force, $F_N$ (N)"
    assert labels_of(figures["figure_9_leg_angle.png"]) == {time, angle}
    assert labels_of(figures["figure_10_contact_force.png"]) == {time, force}
    laws = numbers["normal"] | numbers["friction"]
    assert set(laws) == {"ristow-schafer", "hunt-crossley", "bengisu-akay", "coulomb"}
    for law in laws.values():
        assert law["verdict"] == "suits"
        assert law["least_normal_N"] == 0.0
        assert law["least_total_N"] > 10.0
        assert 0.39 < law["most_friction_over_load"] <= 0.5
        # A walk that is left to settle comes to the gait that the search finds.
        assert abs(law["walked_period_difference"]) < 1e-5
    seed = laws["ristow-schafer"]["measures"]
    assert seed["period_s"] == pytest.approx(0.440835, abs=1e-6)
    assert seed["peak_normal_N"] == pytest.approx(308.79, abs=0.05)
    assert laws["hunt-crossley"]["measures"]["peak_normal_N"] < 0.95 * seed["peak_normal_N"]
    assert abs(laws["coulomb"]["deviations_from_seed"]["step_length_m"]) < 1e-4
    gentle, steep = numbers["slopes"]
    assert gentle["outcome"] == "walking"
    assert gentle["peaks_N"][-1] == pytest.approx(308.79, rel=1e-3)
    assert not gentle["force_grows_every_step"]
    assert steep["outcome"] == "fell forward"
    assert steep["angle_grows_every_step"]

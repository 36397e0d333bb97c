"""Gaits of models, laws and drives, at their quick size, against walks that settle and Kuo's."""

import numpy as np
import pytest

from tests.drawn import labels_of, points_of
from tests.experiments.quick import drawn_run, quick_run

pytestmark = pytest.mark.nightly


def test_laws_are_measured_and_judged(tmp_path):
    numbers, figures = drawn_run("force_models", tmp_path)
    assert set(figures) == {
        *(f"force_models_{name}.png" for name in ("normal", "friction", "measures")),
        "figure_9_leg_angle.png",
        "figure_10_contact_force.png",
    }
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


def test_rungs_and_the_way_to_the_rigid_limit(tmp_path):
    axes = {"factor of the path, $s$", "factor of the stiffness, $s$"}
    bare = {*axes, "distance from the rigid gait"}
    numbers, figures = drawn_run("ladder", tmp_path, unitless=bare)
    measures = numbers["measures"]
    costs = points_of(figures["ladder.png"].axes[0], "in a batch")[0][:, 0]
    assert costs.tolist() == [cost["batch_us"] for cost in numbers["costs"].values()]
    for name, path in numbers["paths"].items():
        gaps = points_of(figures["rigid_limit.png"].axes[0], name)[0]
        np.testing.assert_array_equal(gaps, np.transpose([path["factors"], np.abs(path["period"])]))
    (pair,) = numbers["equal_errors"]
    assert pair["rigid"]["error"] <= pair["stribeck"]["error"]
    assert measures["rigid"]["period"] == pytest.approx(0.44378, abs=5e-6)
    assert measures["stribeck"]["period"] == pytest.approx(0.440835, abs=2e-6)
    assert numbers["costs"]["rigid"]["error"] <= numbers["costs"]["stribeck"]["error"]
    # Stiffness alone leads past the rigid gait; damping leads towards it.
    stiff, damped = numbers["paths"]["K alone"], numbers["paths"]["c alone"]
    assert stiff["period"][-1] > 0.0 > stiff["period"][0]
    assert damped["step_length"] == sorted(damped["step_length"])
    assert damped["step_length"][-1] < 0.0
    # So does the gait of a walker with knees, as its feet and stops stiffen.
    rows = numbers["kneed"]["distances"]["c with K^(3/2)"]
    drawn = points_of(figures["kneed_limit.png"].axes[-1], "period")[0]
    np.testing.assert_array_equal(drawn, [[row["factor"], row["period"]] for row in rows])
    for name in ("period", "step_length", "pair", "third"):
        away = np.array([row[name] for row in rows])
        assert (away[1:] < 0.5 * away[:-1]).all(), name


def test_costs_on_level_ground(tmp_path):
    numbers, figures = drawn_run("level_ground", tmp_path)
    left, right = figures["level_ground.png"].axes
    pairs = numbers["simplest"]
    assert len(pairs) == 3
    assert not numbers["simplest_without_gait"]
    for pair in pairs:
        # Kuo 2002: P = v tan α, work ½ P², and a quarter of what gravity must make up for.
        assert pair["impulse_over_speed_tan"] == pytest.approx(1.0, abs=1e-9)
        assert pair["work_over_half_square"] == pytest.approx(1.0, abs=1e-9)
        assert pair["ratio"] == pytest.approx(4.0, rel=0.5 * pair["angle_rad"] ** 2)
    shown = points_of(left, "push-off")[0]
    assert shown[:, 1].tolist() == [pair["cost"] for pair in pairs]
    for name, curve in numbers["seed"].items():
        assert all(point["found"] and point["stable"] for point in curve)
        speeds = [point["speed_m_s"] for point in curve]
        assert speeds == sorted(speeds)
        np.testing.assert_array_equal(points_of(right, name)[0][:, 0], speeds)
    (design,) = numbers["designs"]
    assert design["outcome"] == "converged"
    assert design["speed_m_s"] == pytest.approx(0.28, rel=1e-6)
    assert design["cost_of_transport"] < design["seed_cost"]
    star = points_of(right, "push-off, optimised")[0]
    assert star[:, 1].tolist() == [design["cost_of_transport"]]


def test_costs_of_a_driven_step_fall_towards_the_free_torques(tmp_path):
    numbers, figures = drawn_run("driven_compass", tmp_path)
    by_law = {(row["law"], row["formulation"]): row for row in numbers["rows"]}
    assert all(row["outcome"] == "converged" for row in by_law.values())
    one, other = by_law["PD", "gait by gait"], by_law["PD", "together"]
    assert abs(one["cost"] - other["cost"]) < one["error"] + other["error"]
    cubic, spline = by_law["cubic", "together"], by_law["spline of 6", "together"]
    assert one["above_free"] > cubic["above_free"] > spline["above_free"] > 0.0
    for row in by_law.values():
        assert 1.0 < row["promised"] / row["above_free"] < 1.01
    shown = points_of(figures["driven_compass.png"].axes[2], "spline in time")[0]
    np.testing.assert_array_equal(shown, [[6, spline["above_free"]]])


def test_another_discretisation_has_the_same_optimum(tmp_path):
    numbers, _ = quick_run("driven_collocation", tmp_path)
    (row,) = numbers["rows"]
    assert row["outcome"] == "converged"
    assert row["is_minimum"]
    assert max(row["missed"], row["collocation_missed"]) < 1e-9
    assert abs(row["difference"]) < 1e-9


def test_optima_of_a_library_and_of_fronts_are_proven_and_have_their_slopes(tmp_path):
    numbers, figures = drawn_run("optimal_library", tmp_path)
    known = numbers["library"]
    assert known["converged"] == known["gaits"] == 9
    assert known["without_derivatives"] == 0
    assert known["largest_residual"] < 1e-5 < known["least_curvature"]
    assert all(off["largest"] < 1e-3 for off in known["slopes_from_differences"].values())
    for points in numbers["fronts"].values():
        assert all(point["proven"] and point["holds"] for point in points)
        assert not any(point["dominated"] for point in points)
    first, last = numbers["fronts"]["speed"]
    between = (last["cost"] - first["cost"]) / (last["bound"] - first["bound"])
    assert first["slope"] < between < last["slope"]
    assert numbers["fronts"]["sensitivity_norm"][0]["slope"] < 0.0
    assert len(figures["optimal_library.png"].axes) == 3


def test_footsteps_stay_on_the_gait_and_repeat(tmp_path):
    numbers, _ = drawn_run("long_walks", tmp_path, unitless={"footstep"})
    assert numbers["outcome"] == "walking"
    assert numbers["footsteps"] == 2000
    assert numbers["repeats"] is True
    assert numbers["mean_s"] == pytest.approx(numbers["period_s"], rel=1e-6)
    assert numbers["largest_deviation_s"] < 1e-5 * numbers["period_s"]
    assert numbers["peak_MiB"][1] < numbers["peak_MiB"][0] + 100.0


def test_every_gait_of_the_map_is_found(tmp_path):
    numbers, _ = drawn_run("radius_map", tmp_path)
    (row,) = numbers["rows"]
    assert row["found"] == row["stable"] == row["gaits"] == 64
    # At the seed's own K and c it is 0.457: the map spans values to both sides.
    assert numbers["least_radius"] < 0.457 < numbers["largest_radius"] < 1.0
    for name, seeds in (("K", 0.139), ("c", 0.479)):
        swept = numbers["along"][name]
        assert not any(swept["ending"])
        assert swept["period"][1] == pytest.approx(0.440835, abs=1e-6)
        assert swept["elasticity_peak_normal"][1] == pytest.approx(seeds, abs=1e-3)
        assert max(swept["elasticity_period_error"]) < 1e-4


def test_no_gait_that_walks_settle_on_is_missed(tmp_path):
    numbers, figures = drawn_run("search_robustness", tmp_path)
    assert set(numbers) == {"slope", "mu", "simplest"}
    drawn = np.concatenate(points_of(figures["search_robustness.png"].axes[0]))
    found = [(row["value"], row["period"] / row["cycle"]) for row in numbers["slope"]]
    np.testing.assert_allclose(drawn, found)
    rows = [row for family in numbers.values() for row in family]
    assert not [row for row in rows if row["verdict"] == "missed"]
    assert [row["verdict"] for row in numbers["slope"]] == ["agrees"] * 3
    for row in numbers["slope"]:
        assert abs(row["period"] - row["walked"]) < 1e-6


def test_cycles_of_hybrid_systems_return_by_scipy(tmp_path):
    bare = {"place", "speed", "slow", "fast"}
    numbers, figures = drawn_run("hybrid_systems", tmp_path, unitless=bare)
    assert set(figures) == {"hybrid_systems.png"}
    ball, relay = numbers["systems"].values()
    assert ball["period"] == pytest.approx(1.0 / 3.0, rel=1e-12)
    assert relay["period"] == pytest.approx(np.log(3.0), rel=1e-9)
    assert relay["spectral_radius"] == pytest.approx(1.0 / 27.0, rel=1e-8)
    assert max(ball["off_by_scipy"], relay["off_by_scipy"]) < 1e-8
    assert "| relay feedback |" in (tmp_path / "hybrid_systems.md").read_text()

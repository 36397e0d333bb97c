"""Every experiment runs, at its quick size, and writes its pictures and numbers."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "experiments"

EXPERIMENTS = {
    "paper_figures_4_8": {
        "numbers": {
            "outcome",
            "fig4_strobe",
            "fig5_phase_portrait",
            "fig6_leg_angles",
            "fig7_penetrations",
            "fig8_contact_forces",
        },
        "pictures": {
            "fig4_strobe.png",
            "fig5_phase_portrait.png",
            "fig6_leg_angles.png",
            "fig7_penetrations.png",
            "fig8_contact_forces.png",
            "walk.gif",
        },
    },
    "speed_single": {
        "numbers": {"first_compile_s", "at_equal_error", "points", "reference_difference"},
        "pictures": {"speed_single.png"},
    },
    "speed_batch": {
        "numbers": {"compile_s", "rows", "errors"},
        "pictures": {"speed_batch.png"},
    },
    "sensitivity_K_c_xi": {
        "numbers": {"parameters", "points", "without_a_gait", "disagreement_with_neighbours"},
        "pictures": {"sensitivity_K_c_xi.png"},
    },
    "lanes_speed": {
        "numbers": {"batches", "singles", "derivatives", "gaits_s", "share_of_peak", "scenes"},
        "pictures": {"lanes_speed.png"},
    },
    "gradient_accuracy": {
        "numbers": {"reference_tolerance", "reference", "points"},
        "pictures": {"gradient_accuracy.png"},
    },
}
"""For each script: keys its numbers must have, and pictures it must write."""


def run(name, folder, *options):
    """Runs an experiment's quick size; its numbers."""
    command = [sys.executable, str(FOLDER / f"{name}.py"), "--quick", "--out", str(folder)]
    numbers = folder / "numbers.json"
    done = subprocess.run(
        [*command, "--json", str(numbers), *options],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(numbers.read_text())


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_experiment_writes_its_numbers_and_pictures(name, tmp_path):
    numbers = run(name, tmp_path)
    assert EXPERIMENTS[name]["numbers"] <= set(numbers)
    for picture in EXPERIMENTS[name]["pictures"]:
        assert (tmp_path / picture).stat().st_size > 1000, picture
    if name in CHECKS:
        CHECKS[name](numbers)


def _walks_as_the_paper_says(numbers):
    assert numbers["outcome"] == "walking"
    assert max(numbers["fig8_contact_forces"]["peak_normal_N"]) == pytest.approx(312.6, rel=0.01)
    assert max(numbers["fig7_penetrations"]["largest_m"]) == pytest.approx(0.702e-3, rel=0.01)
    assert numbers["fig6_leg_angles"]["angle_range_leg_1_rad"] == pytest.approx(
        [-0.2479, 0.2824], abs=1e-3
    )


def _agrees_with_an_independent_solve(numbers):
    assert numbers["reference_difference"] < 1e-8
    assert min(point["error"] for point in numbers["points"]["rodas4"]) < 1e-7


def _every_lane_arrives(numbers):
    ours = [row for row in numbers["rows"] if row["way"] == "vmap"]
    assert ours
    assert all(row["failed"] == 0 and row["steps_per_second"] > 0 for row in ours)


def _every_gait_is_found_with_its_elasticities(numbers):
    assert numbers["without_a_gait"] == []
    points = {name: row[len(row) // 2] for name, row in numbers["points"].items()}
    for seed in points.values():
        assert seed["measures"]["period"] == pytest.approx(0.440835, abs=1e-6)
        assert seed["elasticities"]["peak_normal"][:2] == pytest.approx([0.139, 0.479], abs=1e-3)
    for row in numbers["points"].values():
        assert all(max(point["errors"]["period"]) < 1e-4 for point in row)


def _both_precautions_make_derivatives_follow_their_tolerance(numbers):
    points = numbers["points"]["exact laws"]
    assert numbers["reference"]["exact laws"]["unit_multiplier"] < 1e-6
    for name in ("norm", "both"):
        assert points[name][-1]["unit_multiplier"] < 1e-3
        assert points[name][-1]["period_slope"] < 1e-3
    assert points["plain"][-1]["unit_multiplier"] > 1e-3
    assert all(row[-1]["state"] < 1e-5 for row in points.values())


CHECKS = {
    "sensitivity_K_c_xi": _every_gait_is_found_with_its_elasticities,
    "gradient_accuracy": _both_precautions_make_derivatives_follow_their_tolerance,
    "paper_figures_4_8": _walks_as_the_paper_says,
    "speed_single": _agrees_with_an_independent_solve,
    "speed_batch": _every_lane_arrives,
}
"""For some scripts: what their numbers must say."""

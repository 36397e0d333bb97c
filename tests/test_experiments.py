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


CHECKS = {"paper_figures_4_8": _walks_as_the_paper_says}
"""For some scripts: what their numbers must say."""

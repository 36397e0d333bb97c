"""`jaxbiped gait` as a user meets it, against the seed's published gait."""

import math

import numpy as np
import pytest

import jaxbiped as jb
from tests.cli.commands import outputs_of
from tests.drawn import assert_is_drawn, points_of

pytestmark = pytest.mark.slow

MEASURES = "period_s", "step_length_m", "speed_m_s", "peak_normal_N", "spectral_radius"


@pytest.fixture(scope="module")
def gait(tmp_path_factory):
    """The command run once, with every output, and the gait that it finds."""
    outputs = outputs_of(tmp_path_factory.mktemp("gait"), "gait")
    assert outputs.code == 0
    return outputs, jb.find_gait(jb.seed_scene())


@pytest.fixture(scope="module")
def numbers(gait):
    return gait[0].numbers


def test_json_keys(numbers):
    assert set(numbers) == {
        "ending", "period_s", "step_length_m", "speed_m_s", "peak_normal_N", "state", "residual",
        "multipliers", "multiplier_errors", "unit_multiplier_error", "spectral_radius", "stable",
        "bifurcation", "sensitivities", "sensitivity_errors", "elasticities", "walk_ending",
        "solver_steps", "engine", "wall_s", "search", "found_by", "others", "branch_end",
    }  # fmt: skip
    states = {f"state.{name}" for name in numbers["state"]}
    assert len(states) == 8
    for table in ("sensitivities", "sensitivity_errors", "elasticities"):
        assert {"K", "c", "xi", "slope", "hip_mass"} <= set(numbers[table])
        assert set(numbers[table]["K"]) == {*MEASURES, *states}
    assert set(numbers["wall_s"]) == {"import", "total"}


def test_the_seed_walker_s_gait(numbers):
    assert numbers["ending"] == "found"
    assert numbers["period_s"] == pytest.approx(0.4408349, abs=1e-6)
    assert numbers["step_length_m"] == pytest.approx(0.1792270, abs=1e-6)
    assert numbers["speed_m_s"] == pytest.approx(0.1792270 / 0.4408349, abs=1e-5)
    assert numbers["stable"] is True
    assert numbers["bifurcation"] == "none"
    search = (numbers["found_by"], numbers["others"], numbers["branch_end"])
    assert search == ("start", [], "not followed")
    assert numbers["unit_multiplier_error"] < 1e-4
    assert numbers["residual"] < 1e-6
    sizes = [math.hypot(*value) for value in numbers["multipliers"]]
    assert len(sizes) == len(numbers["multiplier_errors"]) == 6
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] == pytest.approx(numbers["spectral_radius"])


def test_slopes_and_stability_stand_under_their_names(gait, numbers, tmp_path):
    found = gait[1]
    place, fields = found.parameters.index("slope"), jb.gait.Measures._fields[:5]
    for table in ("sensitivities", "sensitivity_errors", "elasticities"):
        told, ours = numbers[table]["slope"], getattr(found, table)
        own = (told[name] for name in MEASURES)
        assert list(own) == [float(getattr(ours, name)[place]) for name in fields]
        assert told["state.omega_2"] == float(ours.state.omega_2[place])
    falls = outputs_of(tmp_path, "gait", "--model", "rigid", "--slope", "0.12").numbers
    assert falls["ending"] == "found"
    assert falls["spectral_radius"] > 1.0
    assert falls["stable"] is False


def test_writes_pictures(gait, numbers):
    _, folder, figures, _ = gait[0]
    names = {path.name for path in folder.iterdir()}
    assert names == set(figures) == {"multipliers.png", "elasticities.png", "orbit.png"}
    for figure in figures.values():
        assert_is_drawn(figure, unitless={"d log measure / d log parameter"})
    drawn = points_of(figures["multipliers.png"].axes[0], "multipliers")[0]
    np.testing.assert_allclose(drawn, numbers["multipliers"][: len(drawn)], atol=1e-3)
    start = numbers["state"]["theta_1"], numbers["state"]["omega_1"]
    assert points_of(figures["orbit.png"].axes[0])[0][0] == pytest.approx(start, abs=1e-6)


def test_a_search_that_fails_says_so(tmp_path, capsys):
    """On so steep a slope the simplest walker falls; uphill the rigid one gains no energy."""
    outputs = outputs_of(tmp_path, "gait", "--walker", "garcia", "--slope", "0.4")
    code, folder, figures, numbers = outputs
    assert code == 1
    (printed,) = capsys.readouterr().out.strip().splitlines()
    for word in ("no return after 1 cycle", "fell forward", "theta_1 = -0.2479"):
        assert word in printed
    assert (numbers["ending"], numbers["walk_ending"]) == ("no return", "fell forward")
    assert numbers["period_s"] is None
    assert numbers["multipliers"] == [[None, None]] * 3
    assert numbers["stable"] is False
    assert figures == {}
    assert not list(folder.iterdir())
    outputs = outputs_of(tmp_path, "gait", "--model", "rigid", "--slope", "-0.01")
    assert outputs.code == 1
    assert outputs.numbers["ending"] == "not converged"
    (printed,) = capsys.readouterr().out.strip().splitlines()
    assert f"not converged after 4 cycles, residual {outputs.numbers['residual']:.2e}" in printed

"""`jaxbiped gait` as a user meets it, against the seed's published gait."""

import dataclasses
import math

import numpy as np
import pytest

import jaxbiped as jb
from tests.cli.commands import outputs_of
from tests.drawn import assert_is_drawn, points_of

pytestmark = pytest.mark.slow

MEASURES = "period_s", "step_length_m", "speed_m_s", "peak_normal_N", "spectral_radius"


def outputs_with(find, folder):
    """What the command leaves whose search is this function."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jb, "find_gait", find)
        return outputs_of(folder, "gait")


@pytest.fixture(scope="module")
def gait(tmp_path_factory):
    """The command run once, with every output, and the gait that it found."""
    found, find_gait = [], jb.find_gait

    def find(*arguments, **options):
        found.append(find_gait(*arguments, **options))
        return found[-1]

    outputs = outputs_with(find, tmp_path_factory.mktemp("gait"))
    assert outputs.code == 0
    return outputs, found[0]


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
    unstable = found.measures._replace(spectral_radius=np.asarray(1.01))
    falls = dataclasses.replace(found, measures=unstable)
    assert outputs_with(lambda *_, **__: falls, tmp_path).numbers["stable"] is False


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


def test_a_search_that_fails_says_so(gait, tmp_path, capsys):
    lost = dataclasses.replace(
        gait[1],
        ending=np.asarray(int(jb.gait.Search.NOT_CONVERGED)),
        walk_ending=np.asarray(int(jb.Ending.FELL_FORWARD)),
        residual=np.asarray(0.0123),
        measures=gait[1].measures._replace(period=np.asarray(np.nan)),
        multipliers=np.full(6, np.nan + 0j),
    )
    code, folder, figures, numbers = outputs_with(lambda *_, **__: lost, tmp_path)
    assert code == 1
    (printed,) = capsys.readouterr().out.strip().splitlines()
    for word in ("not converged", "1.23e-02", "fell forward", "hip_z = 0.399354"):
        assert word in printed
    assert (numbers["ending"], numbers["walk_ending"]) == ("not converged", "fell forward")
    assert numbers["period_s"] is None
    assert numbers["multipliers"] == [[None, None]] * 6
    assert numbers["stable"] is False
    assert figures == {}
    assert not list(folder.iterdir())

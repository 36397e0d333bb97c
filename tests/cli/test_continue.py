"""`jaxbiped continue` as a user meets it, against the branch's own numbers."""

import pytest
import xarray

import jaxbiped as jb
from tests.cli.commands import interrupt_after, numbers_of, one_line, outputs_of, run
from tests.drawn import assert_is_drawn

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    """The command run once, with every output."""
    along = ["--along", "slope", "--from", "0.01", "--to", "0.11"]
    return outputs_of(tmp_path_factory.mktemp("continue"), "continue", "--model", "rigid", *along)


def test_the_numbers(followed):
    assert followed.code == 0
    numbers = followed.numbers
    for point in numbers["points"]:
        assert set(point) == {
            "slope", "value", "period_s", "step_length_m", "multipliers", "multiplier_errors",
            "stable",
        }  # fmt: skip
        assert len(point["multipliers"]) == len(point["multiplier_errors"]) == 3
        assert all(len(pair) == 2 for pair in point["multipliers"])
        assert point["stable"] in (True, False, None)
    (event,) = numbers["bifurcations"]
    assert set(event) == {"kind", "value", "multiplier", "error", "value_error", "beyond"}
    assert 0.0 < event["value_error"] < 1e-4
    assert event["kind"] == "period-doubling"
    assert 0.1 < event["value"] < 0.102
    assert event["multiplier"] == pytest.approx([-1.0, 0.0], abs=1e-6)
    assert [end["end"] for end in numbers["ends"]] == ["reached", "reached"]
    assert numbers["points"][0]["value"] == pytest.approx(0.01, abs=1e-12)


def test_figures_and_dataset(followed):
    figures = followed.figures
    assert set(figures) == {"branch.png", "spectral_radius.png"}
    for figure in figures.values():
        assert_is_drawn(figure)
    scene = jb.RigidScene(walker=jb.seed_scene().walker, ground=jb.Ground(slope=0.02))
    branch = jb.continuation.open_branch(xarray.open_dataset(followed.folder / "branch.nc"), scene)
    assert len(branch.bifurcations) == 1


def test_what_is_printed(capsys, stages_at_once):
    assert run("continue", "--model", "rigid", "--from", "0.018", "--to", "0.022") == 0
    printed = capsys.readouterr()
    assert "following the gait along slope" in printed.err
    said = printed.out
    assert "slope rad" in said
    assert "last end at slope = 0.022: reached (the range ends)" in said
    numbers = numbers_of(capsys, "continue", "--model", "rigid", "--from", "0.018", "--to", "0.022")
    assert set(numbers) >= {"points", "bifurcations"}


def test_no_gait_is_exit_code_1(capsys):
    level = ("--model", "rigid", "--slope", "0", "--from", "-0.001", "--to", "0")
    assert run("continue", *level) == 1
    assert capsys.readouterr().out.startswith("no gait")


BRIEF = ("continue", "--model", "rigid", "--from", "0.018", "--to", "0.022")


@pytest.mark.parametrize(("count", "before"), [(5, 5), (40, None)])
def test_ctrl_c_keeps_the_gaits_so_far_and_tells_where_they_end(
    count, before, tmp_path, monkeypatch, capsys
):
    interrupt_after(monkeypatch, count)
    outputs = outputs_of(tmp_path, *BRIEF)
    printed, line = one_line(capsys)
    values = [point["value"] for point in outputs.numbers["points"]]
    first, last = outputs.numbers["ends"]
    assert outputs.code == 130
    assert line.startswith(f"jaxbiped: Interrupted: the branch has the {len(values)} gaits so far")
    assert (first["value"], last["value"]) == (values[0], values[-1])
    assert last["end"] == "interrupted"
    assert f"last end at slope = {values[-1]:.8g}: interrupted" in printed
    assert (outputs.folder / "branch.nc").is_file()
    if before is None:  # the way down was done
        assert (first["end"], first["value"]) == ("reached", pytest.approx(0.018, abs=1e-12))
        assert 0.02 < values[-1] < 0.022
    else:  # nothing above the first gait was followed
        assert first["end"] == "interrupted"
        assert values[-1] == pytest.approx(0.02, abs=1e-12)
        assert 0.018 < values[0] < 0.02


def test_a_branch_that_is_cut_off_by_its_points_says_so_by_its_code(capsys):
    assert run(*BRIEF, "--max-points", 2) == 1
    assert "unfinished (2 points were followed)" in capsys.readouterr().out


def test_a_range_may_have_a_unit(capsys):
    told = numbers_of(capsys, *BRIEF[:4], "18mrad", *BRIEF[5:])
    assert told["points"][0]["value"] == pytest.approx(0.018, abs=1e-12)

"""`jaxbiped trade`, against errors that fall with the tolerance."""

import json

import pytest

from jaxbiped.cli import main
from tests.drawn import assert_is_drawn, saved_figures


def _run(*arguments):
    with pytest.raises(SystemExit) as stopped:
        main(list(arguments))
    return stopped.value.code


@pytest.mark.nightly
def test_errors_and_costs_of_the_named_accuracies(capsys, tmp_path):
    made = tmp_path / "made"
    with saved_figures() as figures:
        assert _run("trade", "--duration", "0.5", "--json", "-", "--out", str(made)) == 0
    assert set(figures) == {
        f"trade_{axis}.png"
        for axis in ("state", "step_time", "energy", "period", "multiplier", "gradient")
    }
    for name, figure in figures.items():
        assert (made / name).is_file()
        assert_is_drawn(figure)
    numbers = json.loads(capsys.readouterr().out)
    assert max(numbers["floors"]["walk"].values()) < 1e-9
    rows = numbers["rows"]
    assert all(row["outcome"] == "ok" and row["seconds"] > 0.0 for row in rows)
    usual = (("walk", "rodas4p", "state"), ("gait", "rodas4", "multiplier"))
    for of, solver, axis in usual:
        draft, balanced, tight = (
            row for row in rows if row["of"] == of and row["way"] == f"{solver} by lanes"
        )
        assert [row["setting"] for row in (draft, balanced, tight)] == [
            "draft",
            "balanced",
            "tight",
        ]
        assert draft["errors"][axis] > balanced["errors"][axis] > tight["errors"][axis]
    best = numbers["cheapest"]["walk"]["state"]
    assert best["1e-08"]["setting"] == "tight"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--model", "rigid"), "compliant and minimal are measured"),
        (("--formulation", "redundant"), "compliant and minimal are measured"),
        (("--duration", "-1"), "duration = -1"),
        (("--repeats", "0"), "repeats = 0"),
        (("--out", "/proc/nowhere"), "--out"),
    ],
)
def test_bad_flags_are_one_sentence(arguments, said, capsys):
    assert _run("trade", *arguments) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1

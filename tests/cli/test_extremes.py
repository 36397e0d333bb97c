"""`jaxbiped extremes`, against the catalogue's counts."""

import json

import pytest

from jaxbiped.cli import main


def _run(*arguments):
    with pytest.raises(SystemExit) as stopped:
        main(list(arguments))
    return stopped.value.code


@pytest.mark.slow
def test_counts_of_the_quick_cases_and_where_they_go_on(capsys, tmp_path):
    assert _run("extremes", "--quick", "--json", "-", "--out", str(tmp_path)) == 0
    numbers = json.loads(capsys.readouterr().out)
    kept = (tmp_path / "extremes.jsonl").read_text()
    verdicts = ("accurate", "flagged", "refused", "silently_wrong", "unresolved")
    assert numbers["run"] == sum(numbers[each] for each in verdicts) == len(kept.splitlines())
    assert numbers["silently_wrong"] == 0
    assert numbers["accurate"] > 0.7 * numbers["run"]
    # What is known is not run again.
    assert _run("extremes", "--quick", "--json", "-", "--out", str(tmp_path)) == 0
    assert json.loads(capsys.readouterr().out) == numbers
    assert (tmp_path / "extremes.jsonl").read_text() == kept


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--out", "/proc/nowhere"), "--out = '/proc/nowhere' is not allowed"),
        (("--json", "/proc/nowhere/numbers.json"), "--json = '/proc/nowhere/numbers.json'"),
    ],
)
def test_bad_flags_are_one_sentence(arguments, said, capsys):
    assert _run("extremes", *arguments) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1

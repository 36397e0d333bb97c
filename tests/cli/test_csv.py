"""`--csv` of commands, against the numbers that `--json` writes."""

import csv
import io

import pytest

from tests.cli.commands import numbers_of, refused, run


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


def table_of(capsys, *arguments):
    """What a command that ends well prints as CSV, nothing else."""
    assert run(*arguments, "--csv", "-") == 0
    return rows_of(capsys.readouterr().out)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["compliant", "rigid"])
def test_a_walk(capsys, tmp_path, model):
    words = ("walk", "--model", model, "--duration", 1.5)
    rows = table_of(capsys, *words)
    told = numbers_of(capsys, *words, "--csv", tmp_path / "walk.csv")["steps"]
    assert [float(row["period [s]"]) for row in rows] == [each["period_s"] for each in told]
    assert rows_of((tmp_path / "walk.csv").read_text()) == rows
    assert len(rows) > 1


@pytest.mark.slow
def test_a_gait_a_branch_and_a_fit(capsys, tmp_path):
    gait = ("gait", "--model", "rigid")
    (row,) = table_of(capsys, *gait)
    assert float(row["period [s]"]) == numbers_of(capsys, *gait)["period_s"]
    measured = tmp_path / "measured.csv"
    length = float(row["step_length [m]"])
    measured.write_text(
        "period [ms],period_error [ms],step_length [cm],step_length_error [cm]\n"
        f"{1e3 * float(row['period [s]'])},0.01,{1e2 * length},0.001\n"
    )
    fit = ("fit", measured, "--model", "rigid", "--J", "0.011", "--vary", "J,d")
    first, second = table_of(capsys, *fit)
    told = numbers_of(capsys, *fit)
    assert float(first["estimate [SI]"]) == told["estimates"]["J"] == pytest.approx(0.0096)
    assert (second["parameter"], second["unit"]) == ("d", "m")
    branch = ("continue", "--model", "rigid", "--from", 0.018, "--to", 0.022)
    points = table_of(capsys, *branch)
    told = numbers_of(capsys, *branch)["points"]
    assert [float(each["slope [rad]"]) for each in points] == [each["slope"] for each in told]
    assert {each["stable"] for each in points} == {"stable"}


def test_both_cannot_print(capsys):
    assert "give one of them a file" in refused("walk --csv - --json -", capsys)
    assert "/no/such/it.csv" in refused("walk --csv /no/such/it.csv", capsys)

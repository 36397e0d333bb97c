"""Work and precision, at the quick size, against independent references."""

import json

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trade")
    return folder, quick_run("trade", folder)


def test_ways_are_told_against_independent_references(made):
    _, (numbers, figures) = made
    assert_is_drawn(figures["trade.png"])
    assert numbers["floors"]["walk"]["state"] < 1e-10
    assert numbers["floors"]["slopes"]["slopes"] < 1e-6
    walks = {(row["way"], row["setting"]): row for row in numbers["rows"]["walk"]}
    loose, tight = (walks["rodas4p (lanes)", f"rtol={r}"] for r in ("0.0001", "1e-06"))
    assert loose["errors"]["state"] > 10.0 * tight["errors"]["state"]
    assert loose["attempted"] < tight["attempted"]


def test_failures_are_rows(made):
    """Differences of walks whose steps differ are no derivatives."""
    numbers = made[1].numbers
    slopes = numbers["rows"]["slopes"]
    assert any(row["outcome"] == "wrong" for row in slopes if "differences" in row["way"])
    assert all(row["outcome"] == "ok" for row in slopes if row["way"].startswith("rodas"))
    rows = [row for found in numbers["rows"].values() for row in found]
    failed = sum(row["outcome"] != "ok" for row in rows)
    assert numbers["counts"] == {"cases": len(rows), "rows": len(rows), "failed": failed}


def test_a_second_run_goes_on_from_the_store(made):
    folder, (numbers, _) = made
    kept = (folder / "trade_quick.jsonl").read_text()
    assert all(json.loads(line) for line in kept.splitlines())
    assert quick_run("trade", folder).numbers["rows"] == numbers["rows"]
    assert (folder / "trade_quick.jsonl").read_text() == kept


def test_equal_errors_lie_between_the_settings_that_enclose_them(made):
    numbers = made[1].numbers
    table = numbers["at_equal_error"]["walk"]["state"]["steps"]["rodas4p (lanes)"]
    known = [steps for steps in table if steps is not None]
    rows = [row for row in numbers["rows"]["walk"] if row["way"] == "rodas4p (lanes)"]
    least, most = sorted(row["attempted"] for row in rows)
    assert known == sorted(known)
    assert all(0.999 * least <= steps <= 1.001 * most for steps in known)


def test_labels_of_a_draw_are_an_axis(made):
    """Looser tolerances label no fewer starts wrongly; none wrong counts as half a start."""
    numbers = made[1].numbers
    rows = {row["setting"]: row for row in numbers["rows"]["basin"] if "rodas4" in row["way"]}
    loose, tight = (rows[f"rtol={r}"] for r in ("0.001", "1e-06"))
    assert loose["errors"]["labels"] > tight["errors"]["labels"] > 0.49 / 128
    assert loose["attempted"] < tight["attempted"]
    for row in rows.values():
        assert row["errors"]["fraction"] <= row["errors"]["walking"] <= row["errors"]["labels"]

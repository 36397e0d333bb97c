"""Study of cases, against the catalogue: its store and its counts."""

import dataclasses

import pytest
from extreme_cases.case import Case
from extreme_cases.catalogue import catalogue
from extreme_cases.store import by_group, counts, reasons, study
from extreme_cases.verdict import VERDICTS, judge


@dataclasses.dataclass(frozen=True)
class Found:
    verdict: str
    reason: str = ""


def judged(case):
    calls.append(case.key)
    wrong = case.group == "c"
    return Found("refused", f"c = {case.at['c']} is not allowed") if wrong else Found("accurate")


calls = []
CASES = [Case("K", {"K": 1.0}), Case("c", {"c": 2.0}), Case("c", {"c": 3.5})]


def test_a_store_is_gone_on_from(tmp_path):
    calls.clear()
    store, shown = tmp_path / "store.jsonl", []
    study(CASES[:2], judged, store=store)
    with store.open("a") as lines:
        lines.write('{"key": "cut o')
    store.write_text(store.read_text() + "\n")
    rows = study(CASES, judged, store=store, follow=shown.append)
    assert calls == [case.key for case in CASES]
    # What another version judged is judged anew.
    store.write_text(store.read_text().replace("version_jaxbiped", "of_another"))
    assert len(study(CASES, judged, store=store)) == 3
    assert calls == 2 * [case.key for case in CASES]
    assert [row["verdict"] for row in shown] == ["accurate", "refused"]
    assert counts(rows, VERDICTS) == {
        "run": 3, "accurate": 1, "flagged": 0, "refused": 2, "silently_wrong": 0, "unresolved": 0
    }  # fmt: skip
    assert by_group(rows, VERDICTS)["c"]["refused"] == 2
    assert reasons(rows, "refused") == {"c = … is not allowed": 2}


def test_the_catalogue_is_large_and_names_each_case_once():
    cases = catalogue()
    keys = {case.key for case in cases}
    assert len(cases) == len(keys) >= 2000
    assert [case.key for case in catalogue()] == [case.key for case in cases]
    assert len(catalogue(quick=True)) < 100


@pytest.mark.slow
def test_of_the_quick_cases_none_is_silently_wrong_and_none_is_run_again(tmp_path):
    cases, store = catalogue(quick=True), tmp_path / "store.jsonl"
    rows = study(cases, judge, store=store)
    found, kept = counts(rows, VERDICTS), store.read_text()
    assert found["run"] == sum(found[each] for each in VERDICTS) == len(kept.splitlines())
    assert found["silently_wrong"] == 0
    assert found["accurate"] > 0.7 * found["run"]
    assert counts(study(cases, judge, store=store), VERDICTS) == found
    assert store.read_text() == kept

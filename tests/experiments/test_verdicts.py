"""Verdicts on extreme cases, against cases where each kind is due and checks that are written."""

import dataclasses
from types import SimpleNamespace

import jax.tree_util as jtu
import numpy as np
import pytest
from extreme_cases import verdict as verdicts
from extreme_cases.case import Case, check_numbers
from extreme_cases.catalogue import catalogue
from extreme_cases.verdict import VERDICTS, by_group, counts, judge, reasons, study
from reference.scipy_solves import Checked

import jaxbiped as jb
from jaxbiped import Trajectory

SHORT = Case("K", {"K": 1e9}, {"K": 1e9}, duration=0.02)
CASE = Case("K", {"K": 1e6}, {"K": 1e6}, duration=0.02)
STATE = np.array([float(leaf) for leaf in jb.seed_state()])


@pytest.fixture
def simulates(monkeypatch):
    """Lets simulations be made by a function."""
    return lambda by: monkeypatch.setattr(jb, "simulate", by)


@pytest.fixture
def spoil(simulates):
    """Has the state of every simulation changed by a function."""
    simulate = jb.simulate

    def by(change):
        def spoilt(*args, **kwargs):
            walk = simulate(*args, **kwargs)
            return dataclasses.replace(walk, state=change(walk.state))

        simulates(spoilt)

    return by


@pytest.mark.slow
def test_a_stiff_walk_is_accurate():
    found = judge(SHORT)
    assert (found.verdict, found.reason, found.outcome) == ("accurate", "", "walking")
    assert found.error <= found.told <= found.wanted == 1e-4
    assert found.doubt < 1e-7


@pytest.mark.slow
def test_a_wrong_state_is_seen(spoil):
    spoil(lambda state: state._replace(theta_1=state.theta_1 + 1e-3))
    found = judge(SHORT)
    assert (found.verdict, found.reason) == ("silently_wrong", "the state is off")
    assert found.error == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.slow
def test_a_state_that_is_no_number_and_does_not_say_so_is_seen(spoil):
    spoil(lambda state: jtu.tree_map(lambda x: x * np.nan, state))
    assert judge(SHORT).verdict == "silently_wrong"


def test_a_traceback_is_silently_wrong(simulates):
    def simulate(*args, **kwargs):
        raise FloatingPointError("of no use")

    simulates(simulate)
    found = judge(SHORT)
    assert found.verdict == "silently_wrong"
    assert "FloatingPointError" in found.reason


FALLEN = {"theta_1": 1.5, "theta_2": -1.5, "height": 1e-3}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "verdict", "said"),
    [
        (Case("depth", {}, changed={"height": -0.3}), "refused", "below the ground"),
        (Case("angles", {}, changed=FALLEN, duration=0.02), "flagged", "ended at its start"),
        (dataclasses.replace(SHORT, asked={"accuracy": 1e-15}), "flagged", "accuracy not met"),
    ],
    ids=["a start underground", "a fallen start", "what a number cannot keep"],
)
def test_what_cannot_be_is_refused_or_flagged_in_a_sentence(case, verdict, said):
    found = judge(case)
    assert found.verdict == verdict
    assert said in found.reason


@pytest.mark.parametrize(
    ("off", "doubt", "met", "lowest", "verdict"),
    [
        (0.9e-4, 1e-7, True, 0.1, "accurate"),
        (1.1e-4, 1e-7, True, 0.1, "silently_wrong"),
        (0.0, 0.31e-4, True, 0.1, "unresolved"),
        (0.0, 0.29e-4, True, 0.1, "accurate"),
        (1.1e-4, 1e-7, False, 0.1, "flagged"),
        (0.0, 1e-7, True, -0.01, "silently_wrong"),
        (np.nan, 1e-7, True, 0.1, "silently_wrong"),
    ],
)
def test_a_verdict_is_by_the_error_that_was_asked_for(
    off, doubt, met, lowest, verdict, simulates, monkeypatch
):
    """The rate of leg 1 is off by so much, in units of √(g/l), where 1e-4 was wanted."""
    moved = STATE + off * np.sqrt(9.8 / 0.4) * np.eye(8)[6]
    error = SimpleNamespace(relative=1e-5, met=met, reason="" if met else "it is too stiff")
    whole = np.asarray(0)
    walk = Trajectory(np.array([0.02]), jb.State(*moved[:, None]), whole, whole, whole, error=error)
    simulates(lambda *_, **__: walk)
    monkeypatch.setattr(verdicts, "checked", lambda *_, **__: Checked(STATE, doubt, lowest))
    found = judge(CASE)
    assert found.verdict == verdict
    assert found.wanted == 1e-4
    if verdict == "accurate":
        assert found.error == pytest.approx(off, abs=1e-15)
        assert (found.told, found.outcome) == (1e-5, "walking")
    if not met:
        assert found.reason == "accuracy not met: it is too stiff"


@pytest.mark.parametrize(
    ("rate", "said"), [(0.1, ""), (-1.0, "no leg rests where it ended as stopped")]
)
def test_a_walker_that_stopped_has_a_leg_that_rests(rate, said):
    """Slower than 0.11 √(g/l), which is 0.54 rad/s on any slope."""
    still = np.array([*STATE[:6], rate, rate])
    numbers = check_numbers(jb.seed_scene(slope=-0.1))
    assert verdicts._wrong_ending(jb.Ending.STOPPED, Checked(still, 0.0, 0.1), numbers) == said


@dataclasses.dataclass(frozen=True)
class Found:
    verdict: str
    reason: str = ""


def test_a_store_is_gone_on_from(tmp_path):
    calls, shown, store = [], [], tmp_path / "store.jsonl"
    cases = [Case("K", {"K": 1.0}), Case("c", {"c": 2.0}), Case("c", {"c": 3.5})]

    def judged(case):
        calls.append(case.key)
        if case.group == "c":
            return Found("refused", f"c = {case.at['c']} is not allowed")
        return Found("accurate")

    study(cases[:2], judged, store=store)
    with store.open("a") as lines:
        lines.write('{"key": "cut o')
    store.write_text(store.read_text() + "\n")
    rows = study(cases, judged, store=store, follow=shown.append)
    assert calls == [case.key for case in cases]
    # What another version judged is judged anew.
    store.write_text(store.read_text().replace("version_jaxbiped", "of_another"))
    assert len(study(cases, judged, store=store)) == 3
    assert calls == 2 * [case.key for case in cases]
    assert [row["verdict"] for row in shown] == ["accurate", "refused"]
    none = dict(flagged=0, silently_wrong=0, unresolved=0)
    assert counts(rows, VERDICTS) == {"run": 3, "accurate": 1, "refused": 2, **none}
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

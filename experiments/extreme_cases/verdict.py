"""Verdicts on cases: accurate, flagged, refused or silently wrong, by the check's equations.

Those of many cases are kept in a file that a later run goes on from.
"""

import dataclasses
import functools
import hashlib
import re
import subprocess
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from _experiment import RowStore, by
from reference.scipy_solves import Checked, checked, distance, scales
from tqdm import tqdm

import jaxbiped as jb

from .case import Case, check_numbers, check_start, start_of

VERDICTS = ("accurate", "flagged", "refused", "silently_wrong", "unresolved")
GROSS = 1e-2
"""Relative error from which a result that names no number is wrong."""
SURE = 0.3
"""Share of the error allowed that the check's own doubt may have."""
_AT_ONCE = 1e-3
"""Share of the time within which a simulation ended at its start."""
_UNTOLD = (jb.Ending.OUT_OF_STEPS, jb.Ending.SOLVER_FAILED, jb.Ending.TIMED_OUT)


Row = dict[str, Any]
"""A case's fields under "case", its verdict's beside."""


@dataclasses.dataclass(frozen=True)
class Verdict:
    """How a case came out.

    Attributes:
        verdict: one of `VERDICTS`.
        reason: the flag, the refusal, or what is wrong; "" where it is accurate.
        outcome: how the simulation or the search ended; "" where it was refused.
        wanted: relative error allowed [–].
        told: relative error that the result itself tells [–]; None where it tells none.
        seconds: of the simulation or the search.
        error: of a simulation by the check [–]; None where it was not compared.
        doubt: of the check itself [–]; None where it was not asked.
        precise: whether the check solved in multiple precision.
        multipliers, elasticities: relative errors of a gait's multipliers and of the elasticities
            of its period [–]; None where they were not compared. doubts: of the check, for both.
        state: of a gait at mid-stance, without x [SI]; empty where none was found.
    """

    verdict: str
    reason: str = ""
    outcome: str = ""
    wanted: float | None = None
    told: float | None = None
    seconds: float = 0.0
    error: float | None = None
    doubt: float | None = None
    precise: bool = False
    multipliers: float | None = None
    elasticities: float | None = None
    doubts: tuple[float, ...] = ()
    state: tuple[float, ...] = ()


def judge(case: Case) -> Verdict:
    """Simulates a case and holds the result against the check."""
    accuracy = case.asked.get("accuracy")
    wanted = float(accuracy) if isinstance(accuracy, float) else GROSS
    begun = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RuntimeWarning)
        try:
            scene, start = case.scene(), case.state()
            asked = dict(case.asked)
            state = start_of(scene, start, asked.pop("dtype", "float64"))
            walk = jb.simulate(scene, state, duration=case.time, save="end", **asked)
            end = np.array([float(leaf) for leaf in walk.final], float)
        except jb.ArgumentError as error:
            return Verdict("refused", str(error))
        except Exception as error:
            return Verdict("silently_wrong", f"{type(error).__name__}: {error}"[:300])
    seconds = time.perf_counter() - begun
    warned = [str(w.message) for w in caught if issubclass(w.category, RuntimeWarning)]
    told = None if walk.error is None else float(walk.error.relative)
    known: dict[str, Any] = dict(
        outcome=str(walk.outcome), wanted=wanted, told=told, seconds=seconds
    )
    flag = _flag(walk, warned)
    finite = bool(np.all(np.isfinite(end)))
    if not finite and not flag:
        return Verdict("silently_wrong", "not a number, and nothing says so", **known)
    reached = float(np.asarray(walk.t)[-1])
    if reached <= _AT_ONCE * case.time or not finite:
        return Verdict("flagged", flag or f"it ended at its start: {walk.outcome}", **known)
    p, begin = check_numbers(scene), check_start(scene, start)
    check = checked(begin, p, reached, doubt=np.inf if flag else SURE * wanted)
    apart = distance(end, check.state, scales(p, begin.size))
    known |= dict(error=_number(apart), doubt=_number(check.doubt), precise=check.precise)
    if flag:
        return Verdict("flagged", flag, **known)
    if not check.doubt <= SURE * wanted:
        return Verdict("unresolved", "the check's own solves part", **known)
    if apart > wanted:
        return Verdict("silently_wrong", "the state is off", **known)
    wrong = _wrong_ending(walk.outcome, check, p)
    return Verdict("silently_wrong" if wrong else "accurate", wrong, **known)


def _flag(walk: jb.Trajectory, warned: list[str]) -> str:
    """What the result itself says against it, one sentence; "" for nothing."""
    if walk.error is not None and not walk.error.met:
        return f"accuracy not met: {walk.error.reason}"
    if walk.outcome in _UNTOLD:
        return f"it ended as {walk.outcome}"
    return warned[0] if warned else ""


def _wrong_ending(outcome: jb.Ending, check: Checked, p: np.ndarray) -> str:
    """What the check's motion has against how the simulation ended; "" for nothing."""
    margin = 1e-3
    if check.lowest < -margin:
        return f"the hip had come down before it ended as {outcome}"
    y = check.state
    depth = p[4] - y[1] + (p[2] - p[4]) * np.cos(y[2:4])
    if outcome == jb.Ending.STOPPED:
        slow = np.sqrt(np.hypot(p[6], p[7]) / p[2]) * 0.11
        if not np.any((depth > -margin * p[2]) & (np.abs(y[6:8]) < slow)):
            return "no leg rests where it ended as stopped"
    if outcome == jb.Ending.STUMBLED and not np.any(depth > -margin * p[2]):
        return "no foot is on the ground where it ended as stumbled"
    return ""


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def study(
    cases: Sequence[Any],
    judge: Callable[[Any], Any],
    *,
    store: Path | None = None,
    follow: Callable[[Row], None] = lambda row: None,
) -> list[Row]:
    """A row for each case; those that the store holds of this version are not judged again.

    Args:
        cases: dataclasses with a `key` and a `group`.
        judge: gives the verdict on a case, a dataclass.
        store: file of JSON lines to read and to add to; None keeps nothing.
        follow: is shown the verdicts that the store holds, for a judge that remembers.
    """
    kept, rows = RowStore(store, **_writer()), []
    todo = sum(case.key not in kept.rows for case in cases)
    with tqdm(total=todo, unit="cases", file=sys.stderr, disable=todo == 0) as bar:
        for case in cases:
            if case.key in kept.rows:
                follow(kept.rows[case.key])
            else:
                row = {"case": dataclasses.asdict(case)} | dataclasses.asdict(judge(case))
                kept.row(case.key, lambda row=row: row)
                bar.update()
            rows.append(kept.rows[case.key])
    return rows


@functools.cache
def _writer() -> dict[str, str]:
    """What judges: the version, and the revision with a digest of its changes."""

    def git(*command: str) -> str:
        asked = ["git", "-C", str(Path(__file__).parents[2]), *command]
        return subprocess.run(asked, capture_output=True, text=True, check=True).stdout

    try:
        revision = git("rev-parse", "HEAD").strip()
        changes = hashlib.sha256(git("diff", "HEAD", "--", "jaxbiped").encode()).hexdigest()[:12]
    except (OSError, subprocess.CalledProcessError):
        revision = changes = "unknown"
    return {"version_jaxbiped": version("jaxbiped"), "revision": revision, "changes": changes}


def counts(rows: Sequence[Row], verdicts: Sequence[str]) -> Row:
    """How many cases were run, and how many came out how."""
    found = Counter(row["verdict"] for row in rows)
    return {"run": len(rows)} | {name: found[name] for name in verdicts}


def by_group(rows: Sequence[Row], verdicts: Sequence[str]) -> dict[str, Row]:
    """The counts of each group, in the order in which groups come first."""
    groups = by("group", ({"group": row["case"]["group"], "row": row} for row in rows))
    return {name: counts([each["row"] for each in own], verdicts) for name, own in groups.items()}


def reasons(rows: Sequence[Row], verdict: str) -> dict[str, int]:
    """How often each reason was told; numbers in it are left out."""
    number = r"-?\d+(\.\d+)?(e[+-]?\d+)?"
    told = [re.sub(number, "…", row["reason"]) for row in rows if row["verdict"] == verdict]
    return dict(Counter(told).most_common())

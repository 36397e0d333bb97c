"""Store of verdicts: of many cases, kept in a file that a later run goes on from."""

import dataclasses
import functools
import hashlib
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from _experiment import RowStore, by
from tqdm import tqdm

Row = dict[str, Any]
"""A case's fields under "case", its verdict's beside."""


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

"""Store of verdicts: of many cases, kept in a file that a later run goes on from."""

import dataclasses
import functools
import hashlib
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

Row = dict[str, Any]
"""A case's fields under "case", its verdict's beside."""


def study(
    cases: Sequence[Any],
    judge: Callable[[Any], Any],
    *,
    store: Path | None = None,
    follow: Callable[[Row], None] | None = None,
) -> list[Row]:
    """Verdicts of cases, in their order; those that the store holds of this version are not run
    again.

    Args:
        cases: dataclasses with a `key` and a `group`.
        judge: gives the verdict on a case, a dataclass.
        follow: is shown the verdicts that the store holds, for a judge that remembers.
        store: file of JSON lines to read and to add to; None keeps nothing.

    Returns:
        A row for each case.
    """
    held = {} if store is None or not store.exists() else _read(store)
    todo = sum(case.key not in held for case in cases)
    rows = []
    with tqdm(total=todo, unit="cases", file=sys.stderr, disable=todo == 0) as bar:
        for case in cases:
            if case.key not in held:
                row = {"key": case.key, "case": dataclasses.asdict(case), "writer": _writer()}
                held[case.key] = row | dataclasses.asdict(judge(case))
                if store is not None:
                    with store.open("a") as lines:
                        lines.write(json.dumps(held[case.key]) + "\n")
                bar.update()
            elif follow is not None:
                follow(held[case.key])
            rows.append(held[case.key])
    return rows


@functools.cache
def _writer() -> dict[str, str]:
    """What judges: the version, and the revision with a digest of its changes."""
    folder = Path(__file__).parents[2]

    def git(*command: str) -> str:
        asked = ["git", "-C", str(folder), *command]
        return subprocess.run(asked, capture_output=True, text=True, check=True).stdout

    try:
        revision = git("rev-parse", "HEAD").strip()
        changes = hashlib.sha256(git("diff", "HEAD", "--", "jaxbiped").encode()).hexdigest()[:12]
    except (OSError, subprocess.CalledProcessError):
        revision = changes = "unknown"
    return {"version_jaxbiped": version("jaxbiped"), "revision": revision, "changes": changes}


def _read(store: Path) -> dict[str, Row]:
    """What this version has judged."""
    held = {}
    for line in store.read_text().splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue  # cut off while it was written
        if row.get("writer") == _writer():
            held[row["key"]] = row
    return held


def counts(rows: Sequence[Row], verdicts: Sequence[str]) -> Row:
    """How many cases were run, and how many came out how."""
    found = Counter(row["verdict"] for row in rows)
    return {"run": len(rows)} | {name: found[name] for name in verdicts}


def by_group(rows: Sequence[Row], verdicts: Sequence[str]) -> dict[str, Row]:
    """The counts of each group, in the order in which groups come first."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row["case"]["group"], []).append(row)
    return {name: counts(each, verdicts) for name, each in groups.items()}


def reasons(rows: Sequence[Row], verdict: str) -> dict[str, int]:
    """How often each reason was told; numbers in it are left out."""
    told = [_without_numbers(row["reason"]) for row in rows if row["verdict"] == verdict]
    return dict(Counter(told).most_common())


def _without_numbers(text: str) -> str:
    return re.sub(r"-?\d+(\.\d+)?(e[+-]?\d+)?", "…", text)

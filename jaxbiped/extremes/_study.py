"""Study of extremes: verdicts of many cases, kept in a store that a later run goes on from."""

import dataclasses
import json
import re
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from jaxbiped._files import strict_json
from jaxbiped._identity import DECISIVE, provenance
from jaxbiped._types import JsonObject


def study(
    cases: Sequence[Any],
    judge: Callable[[Any], Any],
    *,
    store: Path | None = None,
    follow: Callable[[JsonObject], None] | None = None,
) -> list[JsonObject]:
    """Verdicts of cases, in their order; those that the store holds of this version are not run
    again.

    Args:
        cases: dataclasses with a `key` and a `group`.
        judge: gives the verdict on a case, a dataclass.
        follow: is shown the verdicts that the store holds, for a judge that remembers.
        store: file of JSON lines to read and to add to; None keeps nothing.

    Returns:
        For each case its fields under "case", and its verdict's beside.
    """
    writer = {name: provenance()[name] for name in DECISIVE}
    held = {} if store is None or not store.exists() else _read(store, writer)
    todo = sum(case.key not in held for case in cases)
    rows = []
    with tqdm(total=todo, unit="cases", file=sys.stderr, disable=todo == 0) as bar:
        for case in cases:
            if case.key not in held:
                row = {"key": case.key, "case": dataclasses.asdict(case), "writer": writer}
                held[case.key] = row | dataclasses.asdict(judge(case))
                if store is not None:
                    with store.open("a") as lines:
                        lines.write(strict_json(held[case.key], unknown=str) + "\n")
                bar.update()
            elif follow is not None:
                follow(held[case.key])
            rows.append(held[case.key])
    return rows


def _read(store: Path, writer: JsonObject) -> dict[str, JsonObject]:
    """What this version has judged."""
    held = {}
    for line in store.read_text().splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue  # cut off while it was written
        if row.get("writer") == writer:
            held[row["key"]] = row
    return held


def counts(rows: Sequence[JsonObject], verdicts: Sequence[str]) -> JsonObject:
    """How many cases were run, and how many came out how."""
    found = Counter(row["verdict"] for row in rows)
    return {"run": len(rows)} | {name: found[name] for name in verdicts}


def by_group(rows: Sequence[JsonObject], verdicts: Sequence[str]) -> dict[str, JsonObject]:
    """The counts of each group, in the order in which groups come first."""
    groups: dict[str, list[JsonObject]] = {}
    for row in rows:
        groups.setdefault(row["case"]["group"], []).append(row)
    return {name: counts(each, verdicts) for name, each in groups.items()}


def reasons(rows: Sequence[JsonObject], verdict: str) -> dict[str, int]:
    """How often each reason was told; numbers in it are left out."""
    told = [_without_numbers(row["reason"]) for row in rows if row["verdict"] == verdict]
    return dict(Counter(told).most_common())


def _without_numbers(text: str) -> str:
    return re.sub(r"-?\d+(\.\d+)?(e[+-]?\d+)?", "…", text)

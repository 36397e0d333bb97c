"""`python -m tests.mutants`: breaks the package in one place at a time and runs the quick tests.

A copy of the checkout is mutated, never the checkout. A test that fails catches the mutation; it
must pass in the same copy without the mutation, which is asked of all such tests at the end.
"""

import argparse
import json
import math
import queue
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from tests.mutants import drawn_mutants
from tests.mutants.copied_checkout import CopiedCheckout
from tests.mutants.drawing import draw
from tests.mutants.mutations import ROOT, Mutation, mutations

OWN_CACHE = ("_", "compiler/")
"""Begins of the files that say by which key a program is kept, or write programs: such a mutation
has a cache of its own, for it may leave wrong programs there."""


class Verdict(NamedTuple):
    """What became of a mutation.

    Attributes:
        name: of the mutation.
        caught_by: the first test that failed; None for a survivor.
        seconds: that its tests ran.
    """

    name: str
    caught_by: str | None
    seconds: float

    def line(self) -> str:
        word = "survived" if self.caught_by is None else "caught"
        return f"{word:9}{self.seconds:6.0f} s  {self.name:42}{self.caught_by or ''}"


def verdict_on(mutation: Mutation, checkout: CopiedCheckout, cache: Path, *, near: bool) -> Verdict:
    """Runs the tests on one mutation, those nearest to it first; only those if `near`."""
    begin, caught_by = time.perf_counter(), None
    if mutation.file.startswith(OWN_CACHE):
        cache = cache.with_name(f"cache-{mutation.name}")
    source = (ROOT / "jaxbiped" / mutation.file).read_text()
    checkout.write(mutation.file, mutation.mutated(source))
    try:
        for stage in mutation.stages()[: 1 if near else None]:
            tier = "" if mutation.tier == "full" else "not slow"
            caught_by = checkout.first_failure(stage, cache, tier=tier)
            if caught_by is not None:
                break
    finally:
        checkout.write(mutation.file, source)
    return Verdict(mutation.name, caught_by, time.perf_counter() - begin)


def run(chosen: Sequence[Mutation], *, jobs: int, near: bool) -> tuple[list[Verdict], bool]:
    """Verdicts, and whether the tests that caught mutations pass without them."""
    with tempfile.TemporaryDirectory(prefix="jaxbiped-mutants-") as temporary:
        cache = Path(temporary) / "cache"
        copies: queue.SimpleQueue[CopiedCheckout] = queue.SimpleQueue()
        for k in range(min(jobs, len(chosen))):
            copies.put(CopiedCheckout(Path(temporary) / f"copy-{k}"))

        def verdict(mutation: Mutation) -> Verdict:
            checkout = copies.get()
            try:
                found = verdict_on(mutation, checkout, cache, near=near)
            finally:
                copies.put(checkout)
            print(found.line(), flush=True)
            return found

        with ThreadPoolExecutor(jobs) as pool:
            verdicts = list(pool.map(verdict, chosen))
        catching = sorted({v.caught_by for v in verdicts if v.caught_by and "::" in v.caught_by})
        failure = copies.get().first_failure(catching, cache, tier="") if catching else None
    if failure is not None:
        print(f"Fails without any mutation as well: {failure}")
    return verdicts, failure is None


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("only", nargs="*", metavar="NAME", help="mutations, or begins of names")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time (default: 1)")
    parser.add_argument("--near", action="store_true", help="only run the tests tried first")
    parser.add_argument("--list", action="store_true", help="print the mutations and end")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write the verdicts there")
    parser.add_argument("--draw", type=int, default=0, help="draw so many from the whole package")
    parser.add_argument("--seed", type=int, default=0, help="of the draw")
    parser.add_argument("--minutes", type=float, default=math.inf, help="of a draw, for this run")
    parser.add_argument("--observe", action="store_true", help="keep which tests execute what")
    options = parser.parse_args(arguments)
    if options.observe:
        return drawn_mutants.observe(options.jobs)
    if options.draw:
        numbers = [int(number) for number in options.only]
        if options.list:
            for number, drawn in enumerate(draw(options.draw, options.seed)):
                print(f"{number:4} {drawn.title()}")
            return 0
        caught = drawn_mutants.run(
            options.draw,
            options.seed,
            only=numbers,
            near=options.near,
            minutes=options.minutes,
        )
        return 0 if caught else 1
    every, only = mutations(), tuple(options.only)
    chosen = [each for name, each in every.items() if not only or name.startswith(only)]
    if not chosen:
        parser.error(f"no mutation is called {' or '.join(only)}")
    for each in chosen:
        each.mutated((ROOT / "jaxbiped" / each.file).read_text())
    if options.list:
        for each in chosen:
            print(f"{each.name:42}{each.tier:7}{each.file}: {each.breaks}")
        return 0
    verdicts, sound = run(chosen, jobs=options.jobs, near=options.near)
    survivors = [each for each in verdicts if each.caught_by is None]
    print(f"\n{len(verdicts)} mutations, {len(survivors)} survived")
    for each in survivors:
        print(f"  {each.name}: {every[each.name].file}: {every[each.name].breaks}")
    if options.json:
        rows = [dict(every[each.name]._asdict(), **each._asdict()) for each in verdicts]
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0 if sound and not survivors else 1


if __name__ == "__main__":
    sys.exit(main())

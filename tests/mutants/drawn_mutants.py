"""Drawn mutants: runs the tests near each mutation of a draw, and says what became of it.

The verdicts are kept beside the draw's seed, so that a run that was stopped goes on where it was.
"""

import ast
import json
import math
import queue
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from tests.mutants import equivalent
from tests.mutants.copied_checkout import CopiedCheckout, OutOfTime
from tests.mutants.drawing import PACKAGE, Drawn, draw
from tests.mutants.executed_blocks import ExecutedBlocks, block_at
from tests.mutants.mutations import ROOT
from tests.mutants.nearness import Nearness

OUT = ROOT / "out" / "mutants"
"""Where verdicts, the map of executed blocks and the programs that tests compile are kept."""
EXECUTED = OUT / "executed.jsonl"
"""The map of executed blocks, where it was observed."""
QUICK, SLOW = "not slow", "slow and not nightly"
"""The tests of `make check`, and those that `make test` has besides."""
_OWN_CACHE = ("_", "caching/", "compiler/")
"""Begins of the files that could leave wrong programs in a cache: theirs is used once."""
_HANGS = 5.0
"""Times that a test must take longer than without the mutation for its time-out to be a catch."""
_FILES_AT_A_TIME = 20
"""Files of tests that are observed in one process."""
_NO_TEST = 5
"""Pytest's code where no test of the tier is in the files."""


class Stage(NamedTuple):
    """Tests that are run together.

    Attributes:
        paths: files or single tests.
        tier: which of them.
        longest: processor time that they may take [s].
    """

    paths: list[str]
    tier: str
    longest: float


class Verdict(NamedTuple):
    """What became of a drawn mutation.

    Attributes:
        number: of the mutation in the draw.
        place: `Drawn.place`, by which it is known again.
        word: "caught", "survived", "open" or "equivalent".
        by: the test that failed, or the reason.
        seconds: that the tests ran.
    """

    number: int
    place: tuple[str, ...]
    word: str
    by: str
    seconds: float

    def line(self, drawn: Drawn) -> str:
        """The verdict as it is printed."""
        return f"{self.number:4} {self.word:10} {self.seconds:4.0f} s  {drawn.title()}  {self.by}"


def stages(drawn: Drawn, nearness: Nearness, executed: ExecutedBlocks) -> list[Stage]:
    """Tests near a mutation, the quickest to tell first."""
    tree = ast.parse((PACKAGE / drawn.file).read_text())
    block = block_at(tree, drawn.file, drawn.line)
    covering = executed.covering(block) if block else []
    near = nearness.files(drawn)
    if covering:
        seen = list(dict.fromkeys(test.split("::")[0] for _, test in covering))
        elsewhere = executed.files().difference(seen)
        near = [file for file in [*near, *seen] if file not in elsewhere]
        near = list(dict.fromkeys(near))
    found = [Stage(_up_to(covering, 20.0), QUICK, 60.0)] if covering else []
    return [
        *found,
        Stage(near[:3], QUICK, 25.0),
        Stage(near[:5], SLOW, 90.0),
        Stage(near[3:12], QUICK, 40.0),
        Stage(near[5:20], SLOW, 240.0),
    ]


def _up_to(covering: Sequence[tuple[float, str]], seconds: float) -> list[str]:
    """The first tests that take so long together, one at least."""
    chosen: list[str] = []
    for took, test in covering:
        seconds -= took
        if chosen and seconds < 0.0:
            break
        chosen.append(test)
    return chosen


class Workshop:
    """A copy of the checkout in which drawn mutations are tried."""

    def __init__(self, folder: Path, cache: Path) -> None:
        self.checkout, self.cache, self.folder = CopiedCheckout(folder), cache, folder
        self.nearness = Nearness()
        self.executed = ExecutedBlocks(EXECUTED)

    def verdict(self, number: int, drawn: Drawn, *, near: bool) -> Verdict:
        """Runs the tests near a mutation until one fails; the nearest quick ones alone if `near`.

        Of these alone no mutation survives: it is "open".
        """
        begin, source = time.perf_counter(), (PACKAGE / drawn.file).read_text()
        cache = self.cache
        if drawn.file.startswith(_OWN_CACHE):
            cache = Path(tempfile.mkdtemp(prefix="cache-", dir=self.folder.parent))
        caught: str | None = None
        every = stages(drawn, self.nearness, self.executed)
        for stage in every[:1] if near else every:
            if not stage.paths:
                continue
            self.checkout.write(drawn.file, drawn.mutated(source))
            try:
                caught = self.checkout.first_failure(
                    stage.paths, cache, tier=stage.tier, longest=stage.longest
                )
            except OutOfTime as late:
                self.checkout.write(drawn.file, source)
                caught = self._hang(str(late), drawn, source, stage)
            finally:
                self.checkout.write(drawn.file, source)
            if caught is not None:
                break
        word = "caught" if caught is not None else "open" if near else "survived"
        return Verdict(number, drawn.place, word, caught or "", time.perf_counter() - begin)

    def _hang(self, test: str, drawn: Drawn, source: str, stage: Stage) -> str | None:
        """Whether a test that was running when time was up has no end for the mutation's sake."""
        if "::" not in test or "%]" in test:  # none was running
            return None
        try:
            self.checkout.first_failure([test], self.cache, tier="", longest=stage.longest / _HANGS)
        except OutOfTime:
            return None
        self.checkout.write(drawn.file, drawn.mutated(source))
        try:
            return self.checkout.first_failure([test], self.cache, tier="", longest=stage.longest)
        except OutOfTime:
            return f"no end: {test}"

    def fail_without(self, tests: Sequence[str]) -> str | None:
        """The first of these tests that fails without any mutation."""
        return self.checkout.first_failure(tests, self.cache, tier="") if tests else None


def interval(caught: int, of: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    if not of:
        return 0.0, 1.0
    z, share = 1.959964, caught / of
    middle = share + z * z / (2 * of)
    half = z * math.sqrt(share * (1 - share) / of + z * z / (4 * of * of))
    return (middle - half) / (1 + z * z / of), (middle + half) / (1 + z * z / of)


def run(
    count: int,
    seed: int,
    *,
    only: Sequence[int] = (),
    near: bool = False,
    minutes: float = math.inf,
) -> bool:
    """Tries a draw's mutations that have no verdict yet; whether nine tenths were caught.

    Args:
        count: how many are drawn, with `seed`.
        only: numbers of those to try, also where they have a verdict; all others where empty.
        near: whether to run the nearest quick tests alone, and leave open what they do not catch.
        minutes: after which none is begun any more.
    """
    end = time.monotonic() + 60.0 * minutes
    drawn, why = draw(count, seed), equivalent.reasons()
    OUT.mkdir(parents=True, exist_ok=True)
    kept = Kept(OUT / f"draw-{seed}.json", drawn)
    for number, each in enumerate(drawn):
        if each.place in why:
            kept.add(Verdict(number, each.place, "equivalent", why[each.place], 0.0))
    waiting = [n for n in only or range(count) if only or n not in kept.verdicts]
    waiting = [n for n in waiting if drawn[n].place not in why]
    with tempfile.TemporaryDirectory(prefix="jaxbiped-mutants-") as temporary:
        workshop = Workshop(Path(temporary) / "copy", OUT / "cache") if waiting else None
        for number in waiting:
            if workshop is None or time.monotonic() > end:
                break
            verdict = workshop.verdict(number, drawn[number], near=near)
            print(verdict.line(drawn[number]), flush=True)
            if verdict.word != "open":
                kept.add(verdict)
        failure = workshop.fail_without(kept.catching(waiting)) if workshop else None
    if failure is not None:
        print(f"Fails without any mutation as well: {failure}")
    return kept.report() and failure is None


def observe(jobs: int) -> int:
    """Keeps which unit tests execute which blocks of the package; the largest of pytest's codes.

    So many processes take the files of tests, some at a time, each in a copy of the checkout. Tests
    that read the package's source may fail in a copy that notes its blocks.
    """
    OUT.mkdir(parents=True, exist_ok=True)
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    names = [path.relative_to(ROOT).as_posix() for path in files if "mutants" not in path.parts]
    with tempfile.TemporaryDirectory(prefix="jaxbiped-mutants-") as temporary:
        copies: queue.SimpleQueue[CopiedCheckout] = queue.SimpleQueue()
        for k in range(jobs):
            checkout = CopiedCheckout(Path(temporary) / f"copy-{k}")
            checkout.note_blocks()
            copies.put(checkout)

        def observe_some(first: int) -> int:
            checkout = copies.get()
            try:
                some = names[first : first + _FILES_AT_A_TIME]
                code = checkout.observe(some, Path(temporary) / f"{first}.jsonl")
                return 0 if code == _NO_TEST else code
            finally:
                copies.put(checkout)

        with ThreadPoolExecutor(jobs) as pool:
            codes = list(pool.map(observe_some, range(0, len(names), _FILES_AT_A_TIME)))
        parts = sorted(Path(temporary).glob("*.jsonl"))
        half = EXECUTED.with_suffix(".unfinished")
        half.write_text("".join(part.read_text() for part in parts))
    half.replace(EXECUTED)
    return max(codes, key=abs)


class Kept:
    """The verdicts on a draw, in a file."""

    def __init__(self, path: Path, drawn: Sequence[Drawn]) -> None:
        self.path, self.drawn = path, drawn
        self.verdicts: dict[int, Verdict] = {}
        rows = json.loads(path.read_text()) if path.exists() else []
        places = {each.place: number for number, each in enumerate(drawn)}
        for row in rows:
            place = tuple(row["place"])
            if place in places and row["word"] != "equivalent":
                again = Verdict(places[place], place, row["word"], row["by"], row["seconds"])
                self.verdicts[again.number] = again

    def add(self, verdict: Verdict) -> None:
        """Keeps a verdict, in the file as well."""
        self.verdicts[verdict.number] = verdict
        rows = [self.verdicts[number]._asdict() for number in sorted(self.verdicts)]
        half = self.path.with_suffix(".unfinished")
        half.write_text(json.dumps(rows, indent=1) + "\n")
        half.replace(self.path)

    def catching(self, numbers: Sequence[int]) -> list[str]:
        """The tests that caught these."""
        verdicts = [self.verdicts[n] for n in numbers if n in self.verdicts]
        return sorted({v.by for v in verdicts if v.word == "caught" and v.by.startswith("tests/")})

    def report(self) -> bool:
        """Prints how many were caught; whether nine tenths of those that could be were."""
        words = [v.word for v in self.verdicts.values()]
        caught, survived = words.count("caught"), words.count("survived")
        of = caught + survived
        low, high = interval(caught, of)
        print(
            f"\n{len(words)} of {len(self.drawn)} drawn: {caught} caught, {survived} survived, "
            f"{words.count('equivalent')} equivalent"
        )
        if of:
            print(f"caught: {caught / of:.1%} of {of}; 95 % interval {low:.1%} to {high:.1%}")
        for number, verdict in sorted(self.verdicts.items()):
            if verdict.word == "survived":
                print(f"{number:5}  {self.drawn[number].title()}")
        return caught >= 0.9 * of

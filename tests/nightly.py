"""The nightly tier: tests of whole programs at size, of which each landing runs two sixths.

`python -m tests.nightly` prints the share of the present time, as `make nightly SHARE=…` takes it.
"""

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple

import pytest

PARTS = 6
"""Parts of the tier of which a landing runs two."""


class Share(NamedTuple):
    """Some of so many like parts of the tier; files stay whole, for their tests share fixtures."""

    numbers: frozenset[int]
    of: int

    @classmethod
    def parse(cls, text: str) -> "Share":
        """From `I/N` or `I,J/N`: of N parts those whose numbers are I and J modulo N."""
        listed, slash, parts = text.partition("/")
        numbers = listed.split(",")
        if not (slash and all(map(str.isdecimal, [*numbers, parts])) and int(parts)):
            raise pytest.UsageError(
                f"--nightly-share={text} is not allowed; give I/N, such as 3/6, or I,J/N"
            )
        return cls(frozenset(int(number) % int(parts) for number in numbers), int(parts))

    def split(self, items: Sequence[Any]) -> tuple[list[Any], list[Any]]:
        """The tests of this share, and all others."""
        nightly = [item for item in items if item.get_closest_marker("nightly")]
        part = deal(Counter(item.path for item in nightly), self.of)
        taken = [item for item in nightly if part[item.path] in self.numbers]
        left = set(map(id, taken))
        return taken, [item for item in items if id(item) not in left]


def deal(tests: Counter[Any], parts: int) -> dict[Any, int]:
    """The part of each file: those with most tests first, each to the part with fewest so far."""
    sizes, part = [0] * parts, {}
    for path in sorted(tests, key=lambda path: (-tests[path], path)):
        part[path] = sizes.index(min(sizes))
        sizes[part[path]] += tests[path]
    return part


def share_of_hour(hour: int) -> str:
    """The two sixths of an hour of the day, UTC: each four hours the next two."""
    first = 2 * (hour // 4) % PARTS
    return f"{first},{first + 1}/{PARTS}"


if __name__ == "__main__":
    print(share_of_hour(datetime.now(UTC).hour))

"""The nightly tier: tests of whole programs at size, of which each landing runs a share."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import pytest


class Share(NamedTuple):
    """One of so many equal parts of the tier; files stay whole, for their tests share fixtures."""

    number: int
    of: int

    @classmethod
    def parse(cls, text: str) -> "Share":
        """From `I/N`: of N parts the one whose number is I modulo N, so that I may be a commit."""
        number, slash, parts = text.partition("/")
        if not (slash and number.isdecimal() and parts.isdecimal() and int(parts)):
            raise pytest.UsageError(f"--nightly-share={text} is not allowed; give I/N, such as 3/6")
        return cls(int(number) % int(parts), int(parts))

    def split(self, items: Sequence[Any]) -> tuple[list[Any], list[Any]]:
        """The tests of this part, and all others."""
        files = sorted({item.path for item in items if item.get_closest_marker("nightly")})
        chosen = set(files[self.number :: self.of])
        taken = [i for i in items if i.path in chosen and i.get_closest_marker("nightly")]
        return taken, [i for i in items if i not in taken]

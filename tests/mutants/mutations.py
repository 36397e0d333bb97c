"""Mutations: places where the package is broken on purpose, read from the tables beside this file.

Each table (`*.toml`) holds the mutations of one part of the package, by name:

    [name-of-the-mutation]
    file = "scene/laws/normal/_viscoelastic.py"   # below jaxbiped/
    stands = '''…'''                       # text that the file holds exactly once
    instead = '''…'''
    breaks = "one line: what is wrong then"
    tests = ["tests/…"]                    # optional: test files to try first
    tier = "check"                         # optional: which tier must fail, "check" or "full"
"""

import tomllib
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
"""The checkout."""
EQUIVALENT = "equivalent.toml"
"""The table of drawn mutations that no test can tell, which is read by `equivalent.py`."""
TABLES = sorted(set(Path(__file__).parent.glob("*.toml")) - {Path(__file__).parent / EQUIVALENT})
TIERS = ("check", "full")


class Mutation(NamedTuple):
    """One place that is broken.

    Attributes:
        name: of the mutation.
        file: below `jaxbiped/`.
        stands: text that the file holds exactly once; `instead` replaces it.
        breaks: what is wrong then, in a line.
        tests: test files that are tried first.
        tier: the tier that must fail, one of `TIERS`.
    """

    name: str
    file: str
    stands: str
    instead: str
    breaks: str
    tests: tuple[str, ...] = ()
    tier: str = "check"

    def mutated(self, source: str) -> str:
        """The file's source with the mutation; a ValueError unless its place is there once."""
        if (count := source.count(self.stands)) != 1:
            raise ValueError(f"{self.name}: {self.file} holds its text {count} times, not once")
        return source.replace(self.stands, self.instead)

    def first_tests(self) -> list[str]:
        """Test files that are tried first: those named, and the module's own."""
        module = Path(self.file)
        own = Path("tests") / module.parent / f"test_{module.stem.lstrip('_')}.py"
        return [*self.tests, *([str(own)] if (ROOT / own).exists() else [])]

    def stages(self) -> list[list[str]]:
        """Paths for pytest, one run after the other, until one fails: the quickest first."""
        folder = Path("tests") / Path(self.file).parent
        while not (ROOT / folder).exists():
            folder = folder.parent
        near = [] if folder == Path("tests") else [str(folder)]
        return [stage for stage in (self.first_tests(), near, ["tests"]) if stage]


def mutations() -> dict[str, Mutation]:
    """All mutations by name, in the order of the tables."""
    found: dict[str, Mutation] = {}
    for table in TABLES:
        for name, row in tomllib.loads(table.read_text()).items():
            if name in found:
                raise ValueError(f"two mutations are called {name}")
            row = dict(row, tests=tuple(row.get("tests", ())))
            found[name] = Mutation(name, **row)
    return found

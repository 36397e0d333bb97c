"""Executed blocks: which tests run which blocks of the package, observed in one run of the suite.

A block is the body of a function, of a branch, of a loop or of a handler. In a copy of the checkout
each begins with a call that notes its number; pytest, with this module as its plugin, writes down
the numbers that each test noted. Every file of tests begins with nothing compiled, for a program
that is kept is not traced again. The map is a hint: it orders the tests that a mutation is given.
"""

import ast
import builtins
import json
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

_NOTE = "__note_block__"
_GUARD = f"import builtins as _b\n_b.{_NOTE} = getattr(_b, '{_NOTE}', id)\n"
"""Where a process of its own runs the package, nobody asks which blocks it runs."""
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


class Block(NamedTuple):
    """Statements that are executed together.

    Attributes:
        name: the file, the function and a number in it: it outlives lines that move.
        body: the statements.
    """

    name: str
    body: list[ast.stmt]

    @property
    def lines(self) -> range:
        """The lines from the first statement to the last."""
        return range(self.body[0].lineno, (self.body[-1].end_lineno or 0) + 1)


def blocks(tree: ast.AST, file: str) -> Iterator[Block]:
    """All blocks within functions of a file."""
    return _blocks(tree, f"{file}:", within=False)


def _blocks(node: ast.AST, prefix: str, *, within: bool) -> Iterator[Block]:
    count = 0
    waiting: list[ast.AST] = [node]
    while waiting:
        here = waiting.pop()
        for child in ast.iter_child_nodes(here):
            if isinstance(child, (*_FUNCTIONS, ast.ClassDef)):
                inner = f"{prefix}{child.name}."
                if isinstance(child, _FUNCTIONS):
                    yield Block(f"{inner}0", child.body)
                yield from _blocks(child, inner, within=isinstance(child, _FUNCTIONS))
            else:
                waiting.append(child)
        for field in ("body", "orelse", "handlers", "finalbody"):
            body = getattr(here, field, None)
            if here is node or not isinstance(body, list) or not within:
                continue
            if not body or not isinstance(body[0], ast.stmt):
                continue
            else_if = isinstance(body[0], ast.If) and body[0].col_offset == here.col_offset
            if not else_if:
                count += 1
                yield Block(f"{prefix}{count}", body)


def block_at(tree: ast.AST, file: str, line: int) -> str | None:
    """The name of the innermost block at a line; None where the import alone executes it."""
    around = [block for block in blocks(tree, file) if line in block.lines]
    return min(around, key=lambda block: len(block.lines)).name if around else None


def note_blocks(package: Path) -> list[str]:
    """Writes the calls into a package's files; the names of its blocks in the order of numbers."""
    names: list[str] = []
    for path in sorted(package.rglob("*.py")):
        source = path.read_text()
        lines, inserted = source.splitlines(keepends=True), []
        for block in blocks(ast.parse(source), path.relative_to(package).as_posix()):
            first = block.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                first = block.body[1] if len(block.body) > 1 else first
            line = min(node.lineno for node in [first, *getattr(first, "decorator_list", [])])
            indent = lines[line - 1][: first.col_offset]
            if indent.strip() == "":
                inserted.append((line - 1, f"{indent}{_NOTE}({len(names)})\n"))
            names.append(block.name)
        for line, text in sorted(inserted, reverse=True):
            lines.insert(line, text)
        if path == package / "__init__.py":
            lines.insert(ast.parse(source).body[1].lineno - 1, _GUARD)
        path.write_text("".join(lines))
    return names


class ExecutedBlocks:
    """The map: for each test its seconds and the blocks that it executes."""

    def __init__(self, path: Path) -> None:
        """Reads what was observed; the map is empty where nothing was."""
        self.tests: dict[str, tuple[float, frozenset[str]]] = {}
        for line in path.read_text().splitlines() if path.exists() else ():
            row = json.loads(line)
            names = row["blocks"]
            for test, (seconds, numbers) in row["tests"].items():
                self.tests[test] = seconds, frozenset(names[k] for k in numbers)

    def files(self) -> set[str]:
        """The files of tests that were observed."""
        return {test.split("::")[0] for test in self.tests}

    def covering(self, block: str) -> list[tuple[float, str]]:
        """The tests that execute a block with their seconds, the quick and particular ones first.

        A test that executes little else is likelier to look at what the block does.
        """
        found = [
            ((0.1 + seconds) * len(executed), seconds, test)
            for test, (seconds, executed) in self.tests.items()
            if block in executed
        ]
        return [(seconds, test) for _, seconds, test in sorted(found)]


# pytest's part, in the copy.


def pytest_addoption(parser: Any) -> None:
    parser.addoption("--executed-blocks", metavar="PATH", help="where the map is written")
    parser.addoption("--block-names", metavar="PATH", help="the blocks' names, as a list")


def pytest_configure(config: Any) -> None:
    noted: set[int] = set()
    setattr(builtins, _NOTE, noted.add)
    config.pluginmanager.register(_Observer(config, noted))


class _Observer:
    """Writes a line for each file of tests when its last test has ended."""

    def __init__(self, config: Any, noted: set[int]) -> None:
        self.path = Path(config.option.executed_blocks)
        self.names = json.loads(Path(config.option.block_names).read_text())
        self.noted = noted
        self.tests: dict[str, tuple[float, list[int]]] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any, nextitem: Any) -> Iterator[None]:
        self.noted.clear()
        begin = time.process_time()
        result = yield
        self.tests[item.nodeid] = round(time.process_time() - begin, 3), sorted(self.noted)
        if nextitem is None or nextitem.path != item.path:
            self._write()
        return result

    def _write(self) -> None:
        used = sorted({k for _, numbers in self.tests.values() for k in numbers})
        place = {k: n for n, k in enumerate(used)}
        tests = {t: (s, [place[k] for k in ks]) for t, (s, ks) in self.tests.items()}
        row = {"blocks": [self.names[k] for k in used], "tests": tests}
        with self.path.open("a") as file:
            file.write(json.dumps(row) + "\n")
        self.tests = {}
        _forget_programs()


def _forget_programs() -> None:
    import jax

    import jaxbiped as jb

    jax.clear_caches()
    jb.clear_caches()
    os.environ["JAXBIPED_CACHE"] = tempfile.mkdtemp(dir=os.environ["JAXBIPED_CACHE"])

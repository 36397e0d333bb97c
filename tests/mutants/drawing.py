"""Drawing: mutations drawn from the syntax tree of the whole package, by a seed and by its source.

A site is a node that some slip of `operators` fits. Each site of the package is as likely as any
other, and so is each slip of a site. The first k of a draw are the same however many are drawn.
"""

import ast
import copy
import functools
import itertools
import random
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from tests.mutants.mutations import ROOT
from tests.mutants.operators import ASSERTED, Slip, slips

PACKAGE = ROOT / "jaxbiped"
_WORDS = ("__repr__", "__str__", "_repr_html_", "_repr_svg_", "__all__")
"""Functions and names whose value only people read."""
_NO_CODE = ("annotation", "returns", "type_params", "decorator_list", "bases", "msg", "exc")
"""Fields of nodes that hold types or words."""
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


class Site(NamedTuple):
    """A node where something can be wrong.

    Attributes:
        file: below `jaxbiped/`.
        within: the function or class, with those around it; "" for the module itself.
        node: the node; `statement` is the one that it lies in.
        lone: whether the statement is all that its block holds.
    """

    file: str
    within: str
    node: ast.AST
    statement: ast.stmt
    lone: bool


class Drawn(NamedTuple):
    """A mutation that was drawn.

    Attributes:
        file: below `jaxbiped/`.
        within: the function or class it lies in.
        kind: of the slip.
        statement: the statement around it, in one line without its block.
        stands: the text that is changed, `instead` what it is then; both without layout.
        nth: which of those in the file that all of the above fits.
        line: of the file, as it was drawn.
        start: the first byte that is replaced, `end` the first one after.
        text: what is written there.
    """

    file: str
    within: str
    kind: str
    statement: str
    stands: str
    instead: str
    nth: int
    line: int
    start: int
    end: int
    text: str

    @property
    def place(self) -> tuple[str, ...]:
        """What it is known by when lines move."""
        return (self.file, self.within, self.statement, self.stands, self.instead, str(self.nth))

    def mutated(self, source: str) -> str:
        """The file's source with the mutation."""
        whole = source.encode()
        return (whole[: self.start] + self.text.encode() + whole[self.end :]).decode()

    def title(self) -> str:
        """The mutation in a line."""
        change = f"{_short(self.stands)} → {_short(self.instead)}"
        return f"{self.file}:{self.line} {self.kind}: {change}"


def draw(count: int, seed: int, package: Path = PACKAGE) -> list[Drawn]:
    """So many mutations of a package, in the order in which they were drawn."""
    chance = random.Random(seed)
    sources = {p.relative_to(package).as_posix(): p.read_text() for p in package.rglob("*.py")}
    everywhere = [s for file in sorted(sources) for s in sites(sources[file], file)]
    chance.shuffle(everywhere)
    made: list[Drawn] = []
    for site in everywhere:
        choices = [slip for slip in slips(site.node) if slip.instead is not None or not site.lone]
        chance.shuffle(choices)
        for slip in choices:
            if (drawn := apply(site, slip, sources[site.file])) is not None:
                made.append(drawn)
                break
        if len(made) == count:
            break
    return _numbered(made, everywhere, sources)


def _numbered(
    made: list[Drawn], everywhere: Iterable[Site], sources: dict[str, str]
) -> list[Drawn]:
    """The same with their numbers among those of their function that look alike."""
    functions = {(drawn.file, drawn.within) for drawn in made}
    alike: dict[tuple[str, ...], list[int]] = {}
    for site in everywhere:
        if (site.file, site.within) in functions:
            looks = (site.file, site.within, _header(site.statement), ast.unparse(site.node))
            alike.setdefault(looks, []).append(_span(site.node, sources[site.file])[0])
    numbers = {
        (*looks, start): number
        for looks, starts in alike.items()
        for number, start in enumerate(sorted(starts))
    }
    return [d._replace(nth=numbers[d.file, d.within, d.statement, d.stands, d.start]) for d in made]


def sites(source: str, file: str) -> list[Site]:
    """All sites of a file, in the order of its syntax tree."""
    return [site for site in _walk(ast.parse(source), file, "", None, False) if slips(site.node)]


def _walk(
    node: ast.AST, file: str, within: str, statement: ast.stmt | None, lone: bool
) -> Iterator[Site]:
    for name, value in ast.iter_fields(node):
        if name in _NO_CODE:
            continue
        children = value if isinstance(value, list) else [value]
        for child in children:
            if not isinstance(child, ast.AST) or _is_left_alone(child):
                continue
            inner, around, alone = within, statement, lone
            if isinstance(child, ast.stmt):
                around, alone = child, len(children) == 1
            if isinstance(child, (*_FUNCTIONS, ast.ClassDef)):
                inner = f"{within}.{child.name}".lstrip(".")
            if around is not None and hasattr(child, "lineno"):
                yield Site(file, inner, child, around, alone)
            yield from _walk(child, file, inner, around, alone)


def _is_left_alone(node: ast.AST) -> bool:
    """Whether it is for readers or checkers of types: no number depends on it."""
    if isinstance(node, ast.JoinedStr | ast.Import | ast.ImportFrom | ast.Assert):
        return True
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True
    if isinstance(node, ast.keyword):
        return node.arg in ASSERTED
    if isinstance(node, ast.If):
        return "TYPE_CHECKING" in ast.unparse(node.test)
    if isinstance(node, _FUNCTIONS):
        overloaded = any("overload" in ast.unparse(each) for each in node.decorator_list)
        return node.name in _WORDS or overloaded
    if isinstance(node, ast.Assign):
        name = getattr(node.targets[0], "id", "")
        makes_type = isinstance(node.value, ast.Call) and "TypeVar" in ast.unparse(node.value.func)
        return name in _WORDS or makes_type
    return isinstance(node, ast.AnnAssign) and "TypeAlias" in ast.unparse(node.annotation)


def apply(site: Site, slip: Slip, source: str) -> Drawn | None:
    """The mutation of a site's source; None where it leaves no Python or the same program."""
    start, end = _span(site.node, source)
    if slip.instead is None:
        text, instead = "pass", "pass"
    else:
        instead = ast.unparse(slip.instead)
        text = instead if isinstance(site.node, ast.stmt) else f"({instead})"
        if isinstance(site.node, ast.stmt):
            text = _indented(text, site.node.col_offset)
        elif isinstance(slip.instead, ast.Constant | ast.Name | ast.Attribute | ast.Call):
            text = instead
    line = site.node.lineno  # type: ignore[attr-defined]
    header, stands = _header(site.statement), ast.unparse(site.node)
    drawn = Drawn(
        site.file, site.within, slip.kind, header, stands, instead, 0, line, start, end, text
    )
    try:
        same = ast.dump(ast.parse(drawn.mutated(source))) == ast.dump(ast.parse(source))
    except SyntaxError:
        return None
    return None if same else drawn


def _indented(text: str, columns: int) -> str:
    first, *rest = text.splitlines()
    return "\n".join([first, *(" " * columns + line for line in rest)])


def _span(node: Any, source: str) -> tuple[int, int]:
    """The bytes of a node in its file."""
    starts = _line_starts(source)
    begin = starts[node.lineno - 1] + node.col_offset
    return begin, starts[node.end_lineno - 1] + node.end_col_offset


@functools.lru_cache(maxsize=8)
def _line_starts(source: str) -> list[int]:
    """The first byte of each line; Python ends lines at nothing but line feeds and returns."""
    return [0, *itertools.accumulate(map(len, source.encode().splitlines(keepends=True)))]


def _header(node: ast.stmt) -> str:
    """The first line of a statement, without what stands in its block."""
    bare = copy.copy(node)
    for name in ("body", "orelse", "handlers", "finalbody"):
        if hasattr(bare, name):
            setattr(bare, name, [])
    return ast.unparse(bare).splitlines()[0]


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= 90 else f"{line[:87]}…"


def counts(drawn: Iterable[Drawn]) -> Counter[str]:
    """How many there are of each kind."""
    return Counter(each.kind for each in drawn)

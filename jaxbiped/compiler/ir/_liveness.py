"""Liveness of a graph's operations, and what follows from it.

Products join the sums that alone use them; what only one branch of a conditional needs is computed
in that branch (code sinking).
"""

from collections import Counter, defaultdict
from collections.abc import Iterable

from jaxbiped.compiler.ir._graph import Block, Value

_STAYS = ("const", "input", "part", "if", "map", "repeat", "held", "taken")


class Liveness:
    """What must be computed for chosen results.

    Attributes:
        values: ids of the values to compute.
        fused: for a sum, which of its two arguments is a product that is used nowhere else.
        absorbed: ids of those products. Chosen here and not by the compiler, so that results do
            not depend on the width of the vectors.
    """

    def __init__(self, results: Iterable[Value]) -> None:
        self.values: set[int] = set()
        self.fused: dict[int, int] = {}
        self.absorbed: set[int] = set()
        self._uses: Counter[int] = Counter()
        found = self._reached(results)
        for value in found:
            if value.op in ("fadd", "fsub"):
                self._fuse(value)

    def __contains__(self, value: Value) -> bool:
        return id(value) in self.values

    def _reached(self, results: Iterable[Value]) -> list[Value]:
        stack, found = list(results), []
        self._uses.update(id(v) for v in stack)
        while stack:
            value = stack.pop()
            if id(value) in self.values:
                continue
            self.values.add(id(value))
            found.append(value)
            sources = [*sources_of(value)]
            self._uses.update(id(s) for s in sources)
            stack.extend(sources)
        return found

    def _fuse(self, value: Value) -> None:
        for place, arg in enumerate(value.args):
            alone = arg.op == "fmul" and self._uses[id(arg)] == 1
            if alone and arg.block is value.block:
                self.fused[id(value)] = place
                self.absorbed.add(id(arg))
                return


def sources_of(value: Value) -> Iterable[Value]:
    """What a value is computed from; of a region, only what this one result needs."""
    if value.op in ("if", "map", "held", "taken"):
        # Its parts ask for what they need.
        return [value.args[0]] if value.op == "if" else []
    if value.op == "repeat":
        _, _, starts, held, ends = value.args
        return [*starts, *held, *ends]
    if value.op != "part":
        return [a for a in value.args if isinstance(a, Value)]
    head, place = value.args
    sources: list[Value] = [head]
    if head.op == "if":
        sources += [head.args[2][place], head.args[3][place]]
    elif head.op == "map":
        sources.append(head.args[3][place // head.args[0]])
    elif head.op == "taken":
        sources += head.args[0][place]
    return sources


def sink_code(results: Iterable[Value]) -> None:
    """Moves operations into the branches that alone need them, for these results of a graph."""
    uses, heads = _uses(results)
    # From outside in: what moves into a branch may move on into one inside of it.
    for head in sorted(heads, key=lambda head: len(head.block.lineage())):
        _sink_into(head, uses)


Uses = dict[int, list[tuple[Value | None, Block | None]]]
"""By id of a value, who uses it: another one, wherever that is; or a block, for a region's part."""


def _uses(results: Iterable[Value]) -> tuple[Uses, list[Value]]:
    """Of all that is needed; and the conditionals among it."""
    uses: Uses = defaultdict(list)
    heads, seen, stack = [], set(), list(results)
    for value in stack:
        uses[id(value)].append((None, None))
    while stack:
        value = stack.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if value.op == "if":
            heads.append(value)
        for source in sources_of(value):
            uses[id(source)].append((value, _within(value, source)))
            stack.append(source)
    return uses, heads


def _within(value: Value, source: Value) -> Block | None:
    """The block inside a region in which a part of it uses a value, if not the one around."""
    if value.op == "part":
        head, place = value.args
        if head.op == "if" and source is head.args[2][place]:
            # A branch that gives what is there otherwise needs it there.
            return None if source is head.args[3][place] else head.args[1]
        if head.op == "map" and source is not head:
            return head.args[1]
    return None


def _sink_into(head: Value, uses: Uses) -> None:
    inside, block = head.args[1], head.block
    moved: list[Value] = []

    def only_here(value: Value) -> bool:
        users = uses.get(id(value), ())
        for user, within in users:
            block = user.block if within is None and user is not None else within
            if block is None or inside not in block.lineage():
                return False
        return bool(users)

    for value in reversed(block.values[: block.values.index(head)]):
        if value.op not in _STAYS and only_here(value):
            value.block = inside
            moved.append(value)
    if not moved:
        return
    gone = {id(value) for value in moved}
    block.values[:] = [value for value in block.values if id(value) not in gone]
    inside.values[:0] = reversed(moved)

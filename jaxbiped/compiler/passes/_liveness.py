"""Liveness of a graph's operations, and the products that join the sums that use them."""

from collections import Counter
from collections.abc import Iterable

from jaxbiped.compiler.ir._graph import Value


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

"""Code sinking into conditionals: what only one branch needs is computed in that branch."""

from collections import defaultdict
from collections.abc import Iterable

from jaxbiped.compiler.ir._graph import Block, Value
from jaxbiped.compiler.passes._liveness import sources_of

_STAYS = ("const", "input", "part", "if", "map", "repeat", "held", "taken")


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

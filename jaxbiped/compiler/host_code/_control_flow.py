"""Control flow: how a host program writes calls, branches and loops."""

from collections.abc import Sequence
from typing import Any

from jaxbiped._jax_versions import CALLS, called_program, scan_counts
from jaxbiped.compiler.host_code._host_writer import (
    Block,
    HostWriter,
    Operation,
    Rule,
    UnwrittenError,
    Value,
)


def _parts(program: Any) -> tuple[Any, Sequence[Any]]:
    """A program's operations and its constants."""
    return getattr(program, "jaxpr", program), getattr(program, "consts", ())


def _call(w: HostWriter, op: Operation) -> list[Any]:
    called = called_program(op.equation)
    assert called is not None
    return w.inline(*called, op.inputs, op.needs)


def _linear_solve(w: HostWriter, op: Operation) -> list[Any]:
    counts, programs = op.params["const_lengths"], op.params["jaxprs"]
    before = counts.matvec + counts.vecmat
    own = op.inputs[before : before + counts.solve]
    rest = op.inputs[before + counts.solve + counts.transpose_solve :]
    return w.inline(*_parts(programs.solve), [*own, *rest], op.needs)


def _platform(w: HostWriter, op: Operation) -> list[Value]:
    kinds = op.params["platforms"]
    here = [k for k, kind in enumerate(kinds) if kind is None or "cpu" in kind]
    return [w.constant(here[0], op.result()[1])]


def _branches(w: HostWriter, op: Operation) -> list[Any]:
    which, *operands = op.inputs
    programs = op.params["branches"]
    if which.constant is not None:
        chosen = programs[min(max(int(which.constant), 0), len(programs) - 1)]
        return w.inline(*_parts(chosen), operands, op.needs)
    results: list[Value | None] = [
        Value(w.block, shape, dtype, shape, w.fresh()) if wanted else None
        for (shape, dtype, _), wanted in zip(op.results(), op.needs, strict=True)
    ]
    asked, last = w.text(which), len(programs) - 1
    # All are written before the first line: what they need of what is outside goes before that.
    insides = [_branch(w, program, operands, results) for program in programs]
    for number, inside in reversed(list(enumerate(insides))):
        how = "if" if number == last else "else" if number == 0 else "elif"
        sense = "" if number == 0 else f" {asked} {'>=' if number == last else '=='} {number}"
        w.block.lines.append(f"{how}{sense}:")
        _close(w.block, inside)
    return results


def _branch(
    w: HostWriter, program: Any, operands: list[Value], results: list[Value | None]
) -> Block:
    """One branch; its results get the names of the conditional's."""
    inside = Block(w.block, branch=True)
    needs = [each is not None for each in results]

    def write() -> list[tuple[str | None, str]]:
        found = w.inline(*_parts(program), operands, needs)
        pairs = [(r, w.full(f)) for r, f in zip(results, found, strict=True) if r and f]
        return [(r.name, w.text(f)) for r, f in pairs]

    _assign(inside, w.inside(inside, write))
    return inside


def _assign(block: Block, pairs: Sequence[tuple[str | None, str]]) -> None:
    """All at once: what is assigned may be what another one was."""
    pairs = [pair for pair in pairs if pair[0] != pair[1]]
    if pairs:
        names, texts = zip(*pairs, strict=True)
        block.lines.append(f"{', '.join(map(str, names))} = {', '.join(texts)}")


def _close(outer: Block, inside: Block) -> None:
    outer.lines += ["    " + line for line in inside.lines or ["pass"]]


def _held(w: HostWriter, block: Block, like: Sequence[Value]) -> list[Value]:
    """What a loop carries, of these at first."""
    return [Value(block, v.shape, v.dtype, v.shape, w.fresh()) for v in like]


def _while(w: HostWriter, op: Operation) -> list[Value]:
    p = op.params
    a, b = p["cond_nconsts"], p["cond_nconsts"] + p["body_nconsts"]
    starts = [w.full(each) for each in op.inputs[b:]]
    inside = Block(w.block)
    held = _held(w, inside, starts)
    _carry_on(w, held, starts)

    def write() -> None:
        (goes_on,) = w.inline(*_parts(p["cond_jaxpr"]), [*op.inputs[:a], *held])
        assert goes_on is not None
        inside.lines.append(f"if not {w.text(goes_on)}: break")
        found = _turn(w, p["body_jaxpr"], [*op.inputs[a:b], *held])
        _carry_on(w, held, found)

    w.inside(inside, write)
    w.block.lines.append("while True:")
    _close(w.block, inside)
    return [Value(w.block, h.shape, h.dtype, h.held, h.name) for h in held]


def _turn(w: HostWriter, program: Any, inputs: list[Value]) -> list[Value]:
    """What one turn of a loop gives."""
    return [w.full(each) for each in w.inline(*_parts(program), inputs) if each is not None]


def _carry_on(w: HostWriter, held: list[Value], found: list[Value]) -> None:
    """The next turn's values in place of this one's."""
    _assign(w.block, [(h.name, w.text(f)) for h, f in zip(held, found, strict=True)])


def _scan(w: HostWriter, op: Operation) -> list[Value]:
    p = op.params
    length = p["length"]
    a, carried = scan_counts(p)
    b = a + carried
    if not length:
        raise UnwrittenError("a scan of no turns")
    items = [w.full(each) for each in op.inputs[b:]]
    starts = [w.full(each) for each in op.inputs[a:b]]
    inside = Block(w.block)
    held, turn = _held(w, inside, starts), w.fresh("i")
    place = Value(inside, (), int, (), turn)
    lists = [w.fresh("l") for _ in op.equation.outvars[b - a :]]
    _carry_on(w, held, starts)

    def write() -> list[Value]:
        parts = [w.emit("{0}[{1}]", [v, place], v.shape[1:], v.dtype) for v in items]
        found = _turn(w, p["jaxpr"], [*op.inputs[:a], *held, *parts])
        rows = found[len(held) :]
        texts = [w.text(row) for row in rows]
        inside.lines.extend(f"{n}.append({t})" for n, t in zip(lists, texts, strict=True))
        _carry_on(w, held, found[: len(held)])
        return rows

    rows = w.inside(inside, write)
    order = f"range({length - 1}, -1, -1)" if p["reverse"] else f"range({length})"
    w.block.lines += [*(f"{name} = []" for name in lists), f"for {turn} in {order}:"]
    _close(w.block, inside)
    ends = [Value(w.block, h.shape, h.dtype, h.held, h.name) for h in held]
    return [*ends, *(_listed(w, n, r, p) for n, r in zip(lists, rows, strict=True))]


def _listed(w: HostWriter, name: str, row: Value, params: dict[str, Any]) -> Value:
    """The rows of a scan, one behind the other."""
    shape = (params["length"], *row.shape)
    turned = "[::-1]" if params["reverse"] else ""
    whole = Value(w.block, shape, row.dtype, shape, w.fresh())
    w.block.lines.append(f"{whole.name} = array({name}){turned}")
    return whole


CONTROL_FLOW: dict[str, Rule] = dict.fromkeys(CALLS, _call) | {
    "custom_vmap_call": lambda w, op: w.inline(*_parts(op.params["call"]), op.inputs, op.needs),
    "custom_linear_solve": _linear_solve,
    "platform_index": _platform,
    "cond": _branches,
    "while": _while,
    "scan": _scan,
}

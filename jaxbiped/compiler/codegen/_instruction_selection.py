"""Instruction selection: each operation of a graph as LLVM's instructions."""

from collections.abc import Sequence

from jaxbiped.compiler.codegen._kernel_target import KernelTarget, flush
from jaxbiped.compiler.codegen._llvm_function import BYTES, FunctionBuilder, vector
from jaxbiped.compiler.ir._graph import Kind

_OF_FLOATS = {"fadd", "fsub", "fmul", "fdiv"}
_OF_WHOLES = {"add", "sub", "mul", "and", "or", "xor", "shl", "lshr", "ashr"}
_INTRINSICS = {"fabs", "sqrt", "rint", "floor", "ceil", "fma"}


def select_instruction(
    text: FunctionBuilder,
    op: str,
    kinds: Sequence[Kind],
    operands: Sequence[str],
    width: int,
    target: KernelTarget,
) -> str:
    """Writes an operation; the name of its result.

    Args:
        text: where to.
        op: its name in the graph.
        kinds: of the result, and of each operand.
        operands: names of vectors of `width` lanes.
        width: see above.
        target: what it is written for.
    """
    kind, of = kinds[0], vector(kinds[1], width)
    if op in _OF_FLOATS or op in _OF_WHOLES:
        return text.assign(f"{op} {of} {operands[0]}, {operands[1]}")
    if op in _INTRINSICS:
        return text.intrinsic(op, kinds, operands, width)
    if op == "fneg":
        return text.assign(f"fneg {of} {operands[0]}")
    if op == "not":
        ones = text.splat_constant("1", Kind.BOOL, width)
        return text.assign(f"xor {of} {operands[0]}, {ones}")
    if op.startswith(("fcmp", "icmp")):
        return text.assign(f"{op} {of} {operands[0]}, {operands[1]}")
    if op == "select":
        result = vector(kind, width)
        chosen = f"{result} {operands[1]}, {result} {operands[2]}"
        return text.assign(f"select {of} {operands[0]}, {chosen}")
    if op.startswith("libm "):
        name = target.library + op.removeprefix("libm ")
        return _per_lane(text, name, operands, width, target.architecture)
    if op == "ldexp":
        return (_scale if target.scales else _scale_by_halves)(
            text, operands[0], operands[1], width
        )
    return _convert(text, op, kinds[1], kind, operands[0], width)


def select_fused(
    text: FunctionBuilder,
    op: str,
    kind: Kind,
    factors: Sequence[str],
    other: str,
    place: int,
    width: int,
) -> str:
    """Writes a sum or difference whose argument at `place` is a product: rounded once."""
    (a, b), c, of = factors, other, vector(kind, width)
    if op == "fsub" and place == 0:
        c = text.assign(f"fneg {of} {c}")
    elif op == "fsub":
        a = text.assign(f"fneg {of} {a}")
    return text.intrinsic("fma", [kind] * 4, [a, b, c], width)


def _convert(text: FunctionBuilder, op: str, old: Kind, new: Kind, operand: str, width: int) -> str:
    wider = BYTES[new] > BYTES[old]
    word = {
        "bitcast": "bitcast",
        "to_int": "fptosi",
        "to_float": "sitofp",
        "resize_float": "fpext" if wider else "fptrunc",
        "resize_int": "sext" if wider else "trunc",
    }[op]
    found = text.assign(f"{word} {vector(old, width)} {operand} to {vector(new, width)}")
    # Out of range is any number, but always the same one.
    return text.assign(f"freeze {vector(new, width)} {found}") if op == "to_int" else found


def _scale(text: FunctionBuilder, x: str, exponent: str, width: int) -> str:
    """x 2ⁿ by one instruction."""
    of, short = vector(Kind.F64, width), vector(Kind.I32, width)
    n = _convert(text, "to_int", Kind.F64, Kind.I32, exponent, width)
    name = f"llvm.ldexp.{'f64.i32' if width == 1 else f'v{width}f64.v{width}i32'}"
    text.declarations.add(f"declare {of} @{name}({of}, {short})")
    return text.assign(f"call {of} @{name}({of} {x}, {short} {n})")


def _scale_by_halves(text: FunctionBuilder, x: str, exponent: str, width: int) -> str:
    """x 2ⁿ by two powers of two, for the smallest results."""
    of, whole = vector(Kind.F64, width), vector(Kind.I64, width)
    one, bias, shift = (text.splat_constant(c, Kind.I64, width) for c in ("1", "1023", "52"))
    n = _convert(text, "to_int", Kind.F64, Kind.I64, exponent, width)
    half = text.assign(f"ashr {whole} {n}, {one}")
    for part in (half, text.assign(f"sub {whole} {n}, {half}")):
        biased = text.assign(f"add {whole} {part}, {bias}")
        bits = text.assign(f"shl {whole} {biased}, {shift}")
        factor = text.assign(f"bitcast {whole} {bits} to {of}")
        x = text.assign(f"fmul {of} {x}, {factor}")
    return x


def _per_lane(
    text: FunctionBuilder, name: str, operands: Sequence[str], width: int, architecture: str
) -> str:
    """A function of the C library, in the lanes that the last operand names."""
    *args, _ = operands
    of = vector(Kind.F64, width)
    text.declarations.add(f"declare double @{name}({', '.join(['double'] * len(args))})")
    if width == 1:
        given = ", ".join(f"double {flush(text, x, architecture)}" for x in args)
        return text.assign(f"call double @{name}({given})")
    found = args[0]
    for lane in range(width):
        ones = [text.assign(f"extractelement {of} {x}, i64 {lane}") for x in args]
        given = ", ".join(f"double {flush(text, x, architecture)}" for x in ones)
        one = text.assign(f"call double @{name}({given})")
        found = text.assign(f"insertelement {of} {found}, double {one}, i64 {lane}")
    return found

"""Kernel target: what differs between the processors that one and the same kernel is written for.

A CPU runs many lanes of a vector in one thread; a graphics device one simulation a thread, and a
warp of threads goes on together. Each operation of a graph becomes a target's instructions.

Numbers too small for leading digits count as zero while a kernel runs on a CPU (flushed
subnormals). No walk needs them, and x86 processors take very long over them: a sixth of a batch's
time went into products that hardly any lane chose. XLA's own programs on a CPU flush them too, so a
walk gives the same bits in a jitted function as in a thread of our own.
"""

from collections.abc import Sequence
from typing import NamedTuple

from jaxbiped.compiler.codegen._llvm_function import BYTES, FunctionBuilder, literal, vector
from jaxbiped.compiler.ir._graph import Kind
from jaxbiped.compiler.runtime._machine_code import Host

WARP_ANY = "jaxbiped_warp_any"
"""Function that tells every thread of a warp whether a condition holds in any of them."""
OWN_LIBRARY = "jaxbiped_"
"""What the names of `library_text`'s functions begin with."""
_X86_BITS = 0x8040
"""Of the register MXCSR: subnormal results are zero, and so are subnormal arguments."""
_ARM_BITS = 1 << 24
"""Of the register FPCR, both."""
_ARM = ("aarch64", "arm64")


class KernelTarget(NamedTuple):
    """A kind of processor.

    Attributes:
        width: simulations in one vector of a thread.
        inner: entries of a map in one vector, where `width` is one.
        scales: whether it multiplies by powers of two in one instruction.
        architecture: the CPU's, in LLVM's words; empty for others (see `begin_flushing`).
        convention: LLVM's word for how its kernels are called.
        votes: whether the threads of a warp go on together (see `WARP_ANY`).
        library: what the names of the C library's functions begin with.
        rest: what the module holds besides the kernel; `declared` what that calls, `defined` the
            names of its functions.
    """

    width: int
    inner: int
    scales: bool
    architecture: str = ""
    convention: str = ""
    votes: bool = False
    library: str = ""
    rest: str = ""
    declared: frozenset[str] = frozenset()
    defined: frozenset[str] = frozenset()

    def declarations(self, own: set[str]) -> list[str]:
        """Lines for all that a module calls but does not define; `own` are its kernel's."""
        return [
            line
            for line in sorted(own | self.declared)
            if line.split("(")[0].rpartition("@")[2] not in self.defined
        ]


def host_target(width: int, host: Host) -> KernelTarget:
    """Vectors of `width` simulations on this machine's CPU."""
    return KernelTarget(width, host.width, host.scales, host.triple.partition("-")[0])


def begin_flushing(text: FunctionBuilder, architecture: str) -> str | None:
    """Writes what flushes subnormals from here on; what `end_flushing` needs to know.

    None for other processors, which keep them.
    """
    if architecture == "x86_64":
        kept = text.room(Kind.I32, 1)
        _call_x86(text, "stmxcsr", kept)
        flags = text.load(kept, Kind.I32, 1)
        changed = text.room(Kind.I32, 1)
        text.store(text.assign(f"or i32 {flags}, {_X86_BITS}"), changed, Kind.I32, 1)
        _call_x86(text, "ldmxcsr", changed)
        return kept
    if architecture in _ARM:
        text.declarations.add("declare i64 @llvm.aarch64.get.fpcr()")
        kept = text.assign("call i64 @llvm.aarch64.get.fpcr()")
        _set_arm(text, text.assign(f"or i64 {kept}, {_ARM_BITS}"))
        return kept
    return None


def end_flushing(text: FunctionBuilder, architecture: str, kept: str | None) -> None:
    """Writes what leaves the processor as it was found."""
    if kept is None:
        return
    if architecture == "x86_64":
        _call_x86(text, "ldmxcsr", kept)
    else:
        _set_arm(text, kept)


def flush(text: FunctionBuilder, number: str, architecture: str) -> str:
    """A number as all instructions take it: what the C library looks at are its bits."""
    if architecture not in ("x86_64", *_ARM):
        return number
    text.declarations.add("declare double @llvm.canonicalize.f64(double)")
    return text.assign(f"call double @llvm.canonicalize.f64(double {number})")


def _call_x86(text: FunctionBuilder, name: str, pointer: str) -> None:
    text.declarations.add(f"declare void @llvm.x86.sse.{name}(ptr)")
    text.line(f"call void @llvm.x86.sse.{name}(ptr {pointer})")


def _set_arm(text: FunctionBuilder, flags: str) -> None:
    text.declarations.add("declare void @llvm.aarch64.set.fpcr(i64)")
    text.line(f"call void @llvm.aarch64.set.fpcr(i64 {flags})")


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
    """Writes an operation of the graph; the name of its result.

    `kinds` are those of the result and of each operand; operands are vectors of `width` lanes.
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
        x, exponent = operands
        scale = _scale if target.scales else _scale_by_halves
        return scale(text, x, exponent, width, target)
    if op == "to_int":
        return _to_int(text, kinds[1], kind, operands[0], width, target)
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
        "to_float": "sitofp",
        "resize_float": "fpext" if wider else "fptrunc",
        "resize_int": "sext" if wider else "trunc",
    }[op]
    return text.assign(f"{word} {vector(old, width)} {operand} to {vector(new, width)}")


def _to_int(
    text: FunctionBuilder, old: Kind, new: Kind, operand: str, width: int, target: KernelTarget
) -> str:
    """Rounds towards zero; out of range and NaN are the least whole number, as x86 has it."""
    of, whole = vector(old, width), vector(new, width)
    found = text.assign(f"freeze {whole} {text.assign(f'fptosi {of} {operand} to {whole}')}")
    if target.architecture == "x86_64":
        return found
    size = text.intrinsic("fabs", [old, old], [operand], width)
    end = 2 ** (8 * BYTES[new] - 1)
    bound = text.splat_constant(literal(end, old), old, width)
    least = text.splat_constant(literal(-end, new), new, width)
    within = text.assign(f"fcmp olt {of} {size}, {bound}")
    return text.assign(
        f"select {vector(Kind.BOOL, width)} {within}, {whole} {found}, {whole} {least}"
    )


def _scale(text: FunctionBuilder, x: str, exponent: str, width: int, target: KernelTarget) -> str:
    """x 2ⁿ by one instruction."""
    of, short = vector(Kind.F64, width), vector(Kind.I32, width)
    n = _to_int(text, Kind.F64, Kind.I32, exponent, width, target)
    name = f"llvm.ldexp.{'f64.i32' if width == 1 else f'v{width}f64.v{width}i32'}"
    text.declarations.add(f"declare {of} @{name}({of}, {short})")
    return text.assign(f"call {of} @{name}({of} {x}, {short} {n})")


def _scale_by_halves(
    text: FunctionBuilder, x: str, exponent: str, width: int, target: KernelTarget
) -> str:
    """x 2ⁿ by two powers of two, for the smallest results."""
    of, whole = vector(Kind.F64, width), vector(Kind.I64, width)
    one, bias, shift = (text.splat_constant(c, Kind.I64, width) for c in ("1", "1023", "52"))
    n = _to_int(text, Kind.F64, Kind.I64, exponent, width, target)
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

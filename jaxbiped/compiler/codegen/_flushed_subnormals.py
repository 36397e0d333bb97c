"""Flushed subnormals: numbers too small for leading digits count as zero while a kernel runs.

No walk needs them, and x86 processors take very long over them: a sixth of a batch's time went into
products that hardly any lane chose. XLA's own programs on a CPU flush them too, so a walk gives the
same bits in a jitted function as in a thread of our own.
"""

from jaxbiped.compiler.codegen._llvm_function import FunctionBuilder
from jaxbiped.compiler.ir._graph import Kind

_X86_BITS = 0x8040
"""Of the register MXCSR: subnormal results are zero, and so are subnormal arguments."""
_ARM_BITS = 1 << 24
"""Of the register FPCR, both."""
_ARM = ("aarch64", "arm64")


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

"""Kernel target: what differs between the processors that one and the same kernel is written for.

A CPU runs many lanes of a vector in one thread; a graphics device one simulation a thread, and a
warp of threads goes on together.

Numbers too small for leading digits count as zero while a kernel runs on a CPU (flushed
subnormals). No walk needs them, and x86 processors take very long over them: a sixth of a batch's
time went into products that hardly any lane chose. XLA's own programs on a CPU flush them too, so a
walk gives the same bits in a jitted function as in a thread of our own.
"""

from typing import NamedTuple

from jaxbiped.compiler.codegen._llvm_function import FunctionBuilder
from jaxbiped.compiler.ir._graph import Kind
from jaxbiped.compiler.runtime._host_cpu import Host

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

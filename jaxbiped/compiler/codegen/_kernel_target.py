"""Kernel target: what differs between the processors that one and the same kernel is written for.

A CPU runs many lanes of a vector in one thread; a graphics device one simulation a thread, and a
warp of threads goes on together.
"""

from typing import NamedTuple

from jaxbiped.compiler.runtime._host_cpu import Host

WARP_ANY = "jaxbiped_warp_any"
"""Function that tells every thread of a warp whether a condition holds in any of them."""
OWN_LIBRARY = "jaxbiped_"
"""What the names of `library_text`'s functions begin with."""


class KernelTarget(NamedTuple):
    """A kind of processor.

    Attributes:
        width: simulations in one vector of a thread.
        inner: entries of a map in one vector, where `width` is one.
        scales: whether it multiplies by powers of two in one instruction.
        architecture: the CPU's, in LLVM's words; empty for others (see `begin_flushing`).
        convention: LLVM's word for how its kernels are called.
        attributes: of the kernel's function, as LLVM writes them.
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
    attributes: str = ""
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

"""PTX kernel: the lanes' kernel for graphics devices, one simulation a thread, and its assembly.

A warp of 32 threads is to it what a vector of 32 lanes is on a CPU: where any of its threads is
done, all go through the refill together, in which those that are not keep what they have.
"""

from typing import NamedTuple

from jaxbiped.caching._caches import bounded_cache
from jaxbiped.compiler.codegen._device_library import library_text
from jaxbiped.compiler.codegen._kernel_target import OWN_LIBRARY, WARP_ANY, KernelTarget
from jaxbiped.compiler.codegen._lane_kernel import ENTRY
from jaxbiped.compiler.runtime._machine_code import foreign_machine, optimised_module

THREADS, BLOCKS = 64, 1
"""Threads of a block, and blocks of one multiprocessor that there must be registers for: few, so
that hardly anything is spilt to memory. Unless it is told a number of blocks, `ptxas` saves
registers in the longest programs."""
_TRIPLE = "nvptx64-nvidia-cuda"
_VOTE = f"""
define internal i1 @{WARP_ANY}(i1 %x) alwaysinline convergent {{
  %any = call i1 @llvm.nvvm.vote.any.sync(i32 -1, i1 %x)
  ret i1 %any
}}
"""
_VOTE_DECLARED = "declare i1 @llvm.nvvm.vote.any.sync(i32, i1)"


class Architecture(NamedTuple):
    """A kind of device: its name, and the oldest PTX that knows it, as LLVM has them."""

    name: str
    features: str


ARCHITECTURES = {
    (8, 0): Architecture("sm_80", "+ptx70"),
    (9, 0): Architecture("sm_90", "+ptx78"),
    (10, 0): Architecture("sm_100", "+ptx86"),
}
"""By compute capability from which on. A driver assembles PTX for newer devices, too."""


def architecture_of(capability: tuple[int, int]) -> Architecture | None:
    """The newest that a device of this compute capability can run; None where there is none."""
    known = [each for each in ARCHITECTURES if each <= capability]
    return ARCHITECTURES[max(known)] if known else None


@bounded_cache(8)
def device_target(threads: int = THREADS, blocks: int = BLOCKS) -> KernelTarget:
    """Devices that run blocks of so many threads.

    Args:
        threads: of a block; whole warps.
        blocks: for how many at once on one multiprocessor there are to be registers.
    """
    library, declared = library_text()
    annotations = f"""!nvvm.annotations = !{{!1, !2}}
!1 = !{{ptr @{ENTRY}, !"maxntidx", i32 {threads}}}
!2 = !{{ptr @{ENTRY}, !"minctasm", i32 {blocks}}}"""
    own = frozenset(OWN_LIBRARY + name for name in ("log", "pow", "sin", "cos"))
    return KernelTarget(
        width=1,
        inner=1,
        scales=False,
        convention="ptx_kernel ",
        votes=True,
        library=OWN_LIBRARY,
        rest=f"{library}\n{_VOTE}{annotations}\n",
        declared=declared | {_VOTE_DECLARED},
        defined=own | {WARP_ANY},
    )


def ptx_text(text: str, architecture: Architecture) -> str:
    """A module's PTX.

    Sums and products are rounded one by one (`.rn`), so that no assembler fuses them anew.
    """
    machine = foreign_machine(_TRIPLE, cpu=architecture.name, features=architecture.features)
    return str(machine.emit_assembly(optimised_module(text, machine, triple=_TRIPLE)))

"""Host CPU: the features that code is generated for."""

from typing import NamedTuple

import llvmlite.binding as llvm

from jaxbiped._environment import VECTOR_VARIABLE, environment_number
from jaxbiped.caching._caches import bounded_cache


class Host(NamedTuple):
    """The CPU that code is made for.

    Attributes:
        triple: architecture and system, in LLVM's words.
        cpu: its model; `features` its instruction sets.
        width: 64-bit numbers in one vector register.
        scales: whether it multiplies by powers of two in one instruction.
    """

    triple: str
    cpu: str
    features: str
    width: int
    scales: bool


@bounded_cache(1)
def host() -> Host:
    """This machine, or what `VECTOR_VARIABLE` leaves of it."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features()
    width = 8 if features.get("avx512f") and features.get("avx512dq") else 4
    if not features.get("avx2") and width == 4:
        width = 2
    text = features.flatten()
    chosen = environment_number(VECTOR_VARIABLE)
    if chosen in _WITHOUT and chosen // 64 < width:
        # What a feature implies goes with it.
        width, text = chosen // 64, f"{text},-{_WITHOUT[chosen]}"
    if width == 8:
        # LLVM else keeps to half registers on some CPUs.
        text += ",-prefer-256-bit"
    return Host(llvm.get_default_triple(), llvm.get_host_cpu_name(), text, width, width == 8)


_WITHOUT = {128: "avx", 256: "avx512f"}
"""The instruction set that gives more bits than these."""

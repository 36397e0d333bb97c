"""Machine code from LLVM's text for the host's CPU, kept, and the threads that run it."""

import ctypes
import hashlib
import os
import threading
import weakref
from collections.abc import Callable
from typing import NamedTuple

import llvmlite
import llvmlite.binding as llvm
import numpy as np
from llvmlite.binding import ffi

from jaxbiped._files import THREADS_VARIABLE, VECTOR_VARIABLE, environment_number
from jaxbiped.caching._caches import Once, bounded_cache
from jaxbiped.caching._disk_cache import read_entry, write_entry

_WITHOUT = {128: "avx", 256: "avx512f"}
"""The instruction set that gives more bits than these."""
_POLL = 0.1
"""How long to wait before looking whether the user interrupts [s]."""


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


def default_threads() -> int:
    """Threads to use where nobody says."""
    chosen = environment_number(THREADS_VARIABLE)
    if chosen is not None:
        return chosen
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_in_threads(
    work: Callable[[], object], workers: int, stop: np.ndarray, *, quick: bool
) -> None:
    """Runs the same work in several threads, which share its queue; `stop` ends it early.

    What is `quick` needs no thread: it is over before a user could interrupt.
    """
    if workers == 1 and quick:
        work()
        return
    # Not their joins: one that an interrupt ends may take a thread that runs for one that stopped.
    ends = [threading.Event() for _ in range(workers)]

    def worked(end: threading.Event) -> None:
        try:
            work()
        finally:
            end.set()

    for end in ends:
        threading.Thread(target=worked, args=(end,), daemon=True).start()
    try:
        for end in ends:
            # Waiting without end would keep the interrupt waiting, too.
            while not end.wait(_POLL):
                pass
    except BaseException:
        stop[0] = 1
        for end in ends:
            end.wait()
        raise


class MachineCode:
    """A loaded function. Who calls its address has to keep it: without it the code is freed.

    Attributes:
        address: of its entry.
    """

    def __init__(self, engine: llvm.ExecutionEngine, entry: str) -> None:
        self._engine = engine
        self.address: int = engine.get_function_address(entry)


_LOADED: weakref.WeakValueDictionary[str, MachineCode] = weakref.WeakValueDictionary()
"""Code that some program still has, by what it was made from."""
_LOCK = threading.Lock()
_KIND = "lanes"
EFFORT = 2
"""Highest level of LLVM's code generation. 0 leaves its passes out, too: the same results, from
code that compiles in a fraction of the time and runs slower; tests choose it."""


def machine_code(text: str, entry: str, *, as_written: bool) -> MachineCode:
    """The code of a module, compiled where neither the process nor the disk has it.

    A module may be compiled `as_written`, without LLVM's passes. These take out of a long loop all
    that its turns share, which then waits in memory for want of registers.
    """
    name = code_name(text, entry, as_written=as_written)
    code = stored_code(name, entry, as_written=as_written, text=text)
    assert code is not None
    return code


def code_name(text: str, entry: str, *, as_written: bool) -> str:
    """By what the code of a module is found again."""
    versions = llvmlite.__version__, llvm.llvm_version_info
    parts = [text, entry, *map(str, (as_written, EFFORT, *host(), *versions))]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def stored_code(
    name: str, entry: str, *, as_written: bool, text: str | None = None
) -> MachineCode | None:
    """The code of this name; None where nobody has it, unless the module's `text` is known."""
    with _LOCK:
        code = _LOADED.get(name)
    if code is None:
        machine = _target_machine(as_written)
        stored = read_entry(_KIND, f"{name}.o")
        if stored is None:
            if text is None:
                return None
            stored = _object_code(_module(text, machine, as_written), machine)
            write_entry(_KIND, f"{name}.o", stored)
        with _LOCK:
            code = _LOADED.get(name)
            if code is None:
                code = _LOADED[name] = _load(stored, machine, entry)
    return code


def _object_code(module: llvm.ModuleRef, machine: llvm.TargetMachine) -> bytes:
    """As `machine.emit_object`, which lets no other thread use LLVM meanwhile, for seconds.

    A module in a context of its own shares nothing with others.
    """
    library, known = ffi.lib, ffi.lib.LLVMPY_TargetMachineEmitToMemory
    emit = ctypes.CDLL(library._name, handle=library._handle).LLVMPY_TargetMachineEmitToMemory
    emit.argtypes, emit.restype = known.argtypes, known.restype
    reason = ctypes.c_char_p()
    buffer = emit(machine, module, True, ctypes.byref(reason))
    if not buffer:
        raise RuntimeError(reason.value)
    try:
        start, size = library.LLVMPY_GetBufferStart(buffer), library.LLVMPY_GetBufferSize(buffer)
        return ctypes.string_at(start, size)
    finally:
        library.LLVMPY_DisposeMemoryBuffer(buffer)


def _target_machine(as_written: bool) -> llvm.TargetMachine:
    cpu, effort = host(), min(EFFORT, 1 if as_written else 2)
    target = llvm.Target.from_triple(cpu.triple)
    return target.create_target_machine(cpu=cpu.cpu, features=cpu.features, opt=effort, jit=True)


def _module(text: str, machine: llvm.TargetMachine, as_written: bool) -> llvm.ModuleRef:
    if EFFORT and not as_written:
        return optimised_module(text, machine)
    module = llvm.parse_assembly(text, llvm.create_context())
    module.verify()
    return module


def foreign_machine(triple: str, *, cpu: str, features: str) -> llvm.TargetMachine:
    """A machine that code is made for but that is not the host."""
    _FOREIGN(_initialise_all)
    target = llvm.Target.from_triple(triple)
    return target.create_target_machine(cpu=cpu, features=features, opt=2)


_FOREIGN = Once[None]()


def _initialise_all() -> None:
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()


def optimised_module(
    text: str, machine: llvm.TargetMachine, *, triple: str | None = None
) -> llvm.ModuleRef:
    """A module after LLVM's passes, ready to be written for a machine; `triple` if not the host."""
    module = llvm.parse_assembly(text, llvm.create_context())
    if triple is not None:
        module.triple, module.data_layout = triple, str(machine.target_data)
    module.verify()
    # No vectorisers: the vectors are there. Sums are never reordered, so results stay the same.
    options = llvm.create_pipeline_tuning_options(speed_level=1)
    options.slp_vectorization = options.loop_vectorization = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return module


def _load(stored: bytes, machine: llvm.TargetMachine, entry: str) -> MachineCode:
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(stored))
    engine.finalize_object()
    return MachineCode(engine, entry)

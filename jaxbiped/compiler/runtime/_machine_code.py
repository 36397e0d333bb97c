"""Machine code from LLVM's text, kept in the process and on disk."""

import hashlib
import os
import tempfile
import threading
import weakref
from pathlib import Path

import llvmlite
import llvmlite.binding as llvm

from jaxbiped.compiler.runtime._host_cpu import Host

CACHE_VARIABLE = "JAXBIPED_CACHE"
"""Environment variable: the folder for compiled code; empty for none on disk."""
_DISK_BYTES = 1 << 30
"""What the folder may hold; code that was read or written longest ago goes first."""
_DIGEST = 32


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


def machine_code(text: str, entry: str, host: Host, *, as_written: bool) -> MachineCode:
    """The code of a module, compiled where neither the process nor the disk has it.

    A module may be compiled `as_written`, without LLVM's passes. These take out of a long loop all
    that its turns share, which then waits in memory for want of registers.
    """
    parts = [text, entry, str(as_written), *map(str, host), *_versions()]
    name = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    with _LOCK:
        code = _LOADED.get(name)
        if code is None:
            code = _LOADED[name] = _load(text, entry, host, as_written, _folder(), name)
        return code


def assembly(text: str, host: Host, *, as_written: bool) -> str:
    """A module as the host's assembly, to look at; see `machine_code`."""
    machine = _target_machine(host, as_written)
    return str(machine.emit_assembly(_module(text, machine, as_written)))


def _versions() -> tuple[str, str]:
    return str(llvmlite.__version__), str(llvm.llvm_version_info)


def _target_machine(host: Host, as_written: bool) -> llvm.TargetMachine:
    target = llvm.Target.from_triple(host.triple)
    effort = 1 if as_written else 2
    return target.create_target_machine(cpu=host.cpu, features=host.features, opt=effort, jit=True)


def _module(text: str, machine: llvm.TargetMachine, as_written: bool) -> llvm.ModuleRef:
    module = llvm.parse_assembly(text)
    module.verify()
    if as_written:
        return module
    # No vectorisers: the vectors are there. Sums are never reordered, so results stay the same.
    options = llvm.create_pipeline_tuning_options(speed_level=1)
    options.slp_vectorization = options.loop_vectorization = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return module


def _load(
    text: str, entry: str, host: Host, as_written: bool, folder: Path | None, name: str
) -> MachineCode:
    machine = _target_machine(host, as_written)
    path = None if folder is None else folder / f"{name}.o"
    stored = None if path is None else _read(path)
    if stored is None:
        stored = bytes(machine.emit_object(_module(text, machine, as_written)))
        if path is not None:
            _write(path, stored)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(stored))
    engine.finalize_object()
    return MachineCode(engine, entry)


def _folder() -> Path | None:
    """Where compiled code is kept: safe to delete at any time."""
    chosen = os.environ.get(CACHE_VARIABLE)
    if chosen is None:
        base = os.environ.get("XDG_CACHE_HOME")
        home = Path(base) if base else Path.home() / ".cache"
        return home / "jaxbiped" / "lanes"
    return Path(chosen) / "lanes" if chosen else None


def _read(path: Path) -> bytes | None:
    """Stored code; None where there is none, or not what was written."""
    try:
        content = path.read_bytes()
        os.utime(path)
    except OSError:
        return None
    digest, code = content[:_DIGEST], content[_DIGEST:]
    return code if hashlib.sha256(code).digest() == digest else None


def _write(path: Path, code: bytes) -> None:
    """Stores code, whole or not at all; without a place to store it there is no harm."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(hashlib.sha256(code).digest() + code)
        os.replace(temporary, path)
        _prune(path.parent)
    except OSError:
        return


def _prune(folder: Path) -> None:
    """Removes what is too much for the disk: who misses it compiles it again."""
    files = [(entry.stat(), entry.path) for entry in os.scandir(folder) if entry.is_file()]
    excess = sum(stat.st_size for stat, _ in files) - _DISK_BYTES
    for stat, name in sorted(files, key=lambda file: file[0].st_mtime_ns):
        if excess <= 0:
            return
        Path(name).unlink(missing_ok=True)
        excess -= stat.st_size

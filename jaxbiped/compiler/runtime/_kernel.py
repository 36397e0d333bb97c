"""Kernel: a program's signature and machine code, kept by the disk or else traced and compiled."""

import dataclasses
import threading

import jax
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped.caching._caches import Once
from jaxbiped.caching._collector_pause import long_trace
from jaxbiped.caching._fingerprint import as_leaves, fingerprint
from jaxbiped.compiler.codegen._kernel_target import host_target
from jaxbiped.compiler.codegen._llvm_lane_loop import ENTRY, kernel_text
from jaxbiped.compiler.codegen._ptx_kernel import (
    BLOCKS,
    THREADS,
    Architecture,
    device_target,
    ptx_text,
)
from jaxbiped.compiler.runtime._host_cpu import host
from jaxbiped.compiler.runtime._machine_code import MachineCode, assembly, code_name, machine_code
from jaxbiped.compiler.runtime._program import Graph, Outline, Program, graph_of, outline_of
from jaxbiped.compiler.runtime._program_store import (
    Signature,
    read_code,
    read_ptx,
    read_signature,
    signature_of,
    write_code_name,
    write_ptx,
    write_signature,
)

_TRACING = threading.Lock()


class Kernel:
    """What runs a program for inputs of one structure.

    Attributes:
        digest: fingerprint of the program and its inputs; None where it has none.
        inputs: pytree of shapes and dtypes.
    """

    def __init__(self, program: Program | None, inputs: PyTree, digest: str | None) -> None:
        self._program, self.inputs, self.digest = program, inputs, digest
        self._code: dict[int, MachineCode] = {}
        self._ptx: dict[str, str] = {}
        self._making = threading.Lock()
        # Each with a lock of its own: who waits for one kernel does not wait for the others.
        self._kept, self._signed = Once[Signature | None](), Once[Signature]()
        self._outlined, self._traced = Once[Outline](), Once[Graph]()

    @staticmethod
    def of_program(program: Program, inputs: PyTree) -> "Kernel":
        """Of a program; `inputs` are one simulation's, or their shapes."""
        shapes = jtu.tree_map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), inputs)
        digest = fingerprint(Kernel, program, as_leaves(shapes))
        # The outline and the graph need these: compiled by themselves, they are traced once.
        once = dataclasses.replace(
            program,
            start=jax.jit(program.start),
            finish=jax.jit(program.finish),
            record=None if program.record is None else jax.jit(program.record),
        )
        return Kernel(once, shapes, digest)

    @staticmethod
    def kept(digest: str) -> "Kernel":
        """What the disk keeps of a program; it cannot be traced.

        Raises:
            KeyError: that is nothing.
        """
        signature = read_signature(digest)
        if signature is None:
            raise KeyError(digest)
        kernel = Kernel(None, signature.inputs, digest)
        kernel._kept(lambda: signature)
        return kernel

    def trace_from(self, other: "Kernel") -> None:
        """Knows from here on how to trace itself."""
        self._program = self._program or other._program

    @property
    def signature(self) -> Signature:
        """What its callers have to know of its operations."""
        return self._signed(self._sign)

    @property
    def outline(self) -> Outline:
        """What leaves the program: known before its operations are."""
        return self._outlined(self._sketch)

    @property
    def graph(self) -> Graph:
        """The program's operations."""
        return self._traced(self._trace)

    def text(self, width: int) -> str:
        """The program as LLVM's text."""
        graph = self.graph
        with long_trace():
            return kernel_text(graph, host_target(width, host()))

    def instructions(self) -> int:
        """How many machine instructions it has, for vectors of the host's width."""
        text = self.text(host().width)
        lines = assembly(text, host(), as_written=self.signature.maps).splitlines()
        return sum(line.startswith("\t") and not line.startswith("\t.") for line in lines)

    def code(self, width: int) -> MachineCode:
        """The machine code, for vectors of this width."""
        with self._making:
            if width not in self._code:
                self._code[width] = self._read_code(width) or self._make_code(width)
            return self._code[width]

    def has_code(self, width: int) -> bool:
        """Whether `code` takes no tracing and no compiling."""
        with self._making:
            code = self._code.get(width) or self._read_code(width)
            if code is not None:
                self._code[width] = code
            return code is not None

    def device_text(self, threads: int = THREADS, blocks: int = BLOCKS) -> str:
        """The program as LLVM's text for devices; see `device_target`."""
        graph = self.graph
        with long_trace():
            return kernel_text(graph, device_target(threads, blocks))

    def ptx(self, architecture: Architecture) -> str:
        """The program as PTX for a kind of device."""
        with self._making:
            if not self._has_ptx(architecture):
                text = ptx_text(self.device_text(), architecture)
                self._ptx[architecture.name] = text
                if self.digest is not None:
                    write_ptx(self.digest, architecture, text)
            return self._ptx[architecture.name]

    def has_ptx(self, architecture: Architecture) -> bool:
        """Whether `ptx` takes no tracing and no compiling."""
        with self._making:
            return self._has_ptx(architecture)

    def _kept_signature(self) -> Signature | None:
        """What the disk knew of it when it was first asked."""
        digest = self.digest
        return self._kept(lambda: None if digest is None else read_signature(digest))

    def _sign(self) -> Signature:
        kept = self._kept_signature()
        if kept is not None:
            return kept
        program = self._own_program()
        found = signature_of(self.graph, self.inputs, self.outline, backwards=program.backwards)
        if self.digest is not None:
            write_signature(self.digest, found)
        return found

    def _sketch(self) -> Outline:
        kept = self._kept_signature()
        if kept is not None:
            return kept.outline
        with long_trace():
            return outline_of(self._own_program(), self.inputs)

    def _trace(self) -> Graph:
        # One after the other: what is traced first can be compiled while the next one is traced.
        with _TRACING, long_trace():
            return graph_of(self._own_program(), self.inputs)

    def _has_ptx(self, architecture: Architecture) -> bool:
        name = architecture.name
        if name not in self._ptx and self.digest is not None:
            kept = read_ptx(self.digest, architecture)
            if kept is not None:
                self._ptx[name] = kept
        return name in self._ptx

    def _read_code(self, width: int) -> MachineCode | None:
        if self.digest is None or self._traced.done:
            return None
        kept = self._kept_signature()
        return None if kept is None else read_code(self.digest, width, host(), maps=kept.maps)

    def _make_code(self, width: int) -> MachineCode:
        text, maps = self.text(width), self.signature.maps
        code = machine_code(text, ENTRY, host(), as_written=maps)
        if self.digest is not None:
            name = code_name(text, ENTRY, host(), as_written=maps)
            write_code_name(self.digest, width, host(), name)
        return code

    def _own_program(self) -> Program:
        if self._program is None:
            raise LookupError(
                "What was kept on disk of a compiled program is gone: jaxbiped.clear_caches(), "
                "and the call compiles it again."
            )
        return self._program

"""Kernel: a program's signature and machine code, kept by the disk or else traced and compiled.

With what the disk keeps, a program that some process had traced runs in another one that never
traces it.
"""

import dataclasses
import math
import threading
import weakref
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import jax
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped.caching._cached_jit import long_trace
from jaxbiped.caching._caches import Once
from jaxbiped.caching._disk_cache import read_entry, read_object, write_entry, write_object
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
from jaxbiped.compiler.runtime._machine_code import (
    MachineCode,
    code_name,
    host,
    machine_code,
    stored_code,
)
from jaxbiped.compiler.runtime._program import Graph, Outline, Program, graph_of, outline_of

_T = TypeVar("_T")
_LONG = 8000
"""Operations of an attempt from which on it counts as long."""
_KIND = "programs"
_TRACING = threading.Lock()
_KNOWING = threading.Lock()
_KNOWN: "weakref.WeakValueDictionary[str, Kernel]" = weakref.WeakValueDictionary()
"""Kernels that somebody has, by their fingerprints."""


class Signature(NamedTuple):
    """What a program's callers have to know of its operations.

    Attributes:
        inputs: pytree of the inputs, with shapes and dtypes.
        outline: what leaves it.
        outputs: how many numbers differ between simulations, `constants` those that do not, by
            their places.
        row: numbers in each row of the stream that it reads.
        recorded: numbers in each record, `records` whether it makes any.
        maps: whether it loops over entries of arrays.
        long: whether an attempt is so long that its instructions do not stay in the caches.
        backwards: whether it reads streams from the last row on.
    """

    inputs: Any
    outline: Outline
    outputs: int
    constants: dict[int, float]
    row: int
    recorded: int
    records: bool
    maps: bool
    long: bool
    backwards: bool


class Kernel:
    """What runs a program for inputs of one structure.

    Attributes:
        inputs: pytree of shapes and dtypes; `size` how many numbers they are.
        digest: fingerprint of the program and its inputs; None where it has none.
        begun: what began to be compiled for it in the background.
    """

    def __init__(self, program: Program | None, inputs: PyTree, digest: str | None) -> None:
        self._program, self.inputs, self.digest = program, inputs, digest
        self.size = sum(math.prod(leaf.shape) for leaf in jtu.tree_leaves(inputs))
        self.begun: dict[tuple[str, int], object] = {}
        self._code: dict[int, MachineCode] = {}
        self._ptx: dict[str, str] = {}
        self._making = threading.Lock()
        # Each with a lock of its own: who waits for one kernel does not wait for the others.
        self._kept, self._signed = Once[Signature | None](), Once[Signature]()
        self._outlined, self._traced = Once[Outline](), Once[Graph]()

    @staticmethod
    def of_program(program: Program, inputs: PyTree) -> "Kernel":
        """The one of a program, which may be in use already; `inputs` of one, or their shapes."""
        shapes = jtu.tree_map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), inputs)
        digest = fingerprint(Kernel, program, as_leaves(shapes))
        # The outline and the graph need these: compiled by themselves, they are traced once.
        once = dataclasses.replace(
            program,
            start=jax.jit(program.start),
            finish=jax.jit(program.finish),
            record=None if program.record is None else jax.jit(program.record),
        )
        made = Kernel(once, shapes, digest)
        if digest is None:
            return made
        with _KNOWING:
            known = _KNOWN.setdefault(digest, made)
            known._program = known._program or once
        return known

    @staticmethod
    def kept(digest: str) -> "Kernel":
        """The one with this fingerprint; what the disk keeps of a program cannot be traced.

        Raises:
            KeyError: neither the process nor the disk has it.
        """
        with _KNOWING:
            known = _KNOWN.get(digest)
            if known is None:
                signature = read_object(_KIND, digest, Signature)
                if signature is None:
                    raise KeyError(digest)
                known = _KNOWN[digest] = Kernel(None, signature.inputs, digest)
                known._kept(lambda: signature)
        return known

    @property
    def signature(self) -> Signature:
        """What its callers have to know of its operations."""
        return self._signed(lambda: self._kept_signature() or self._sign())

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

    def code(self, width: int) -> MachineCode:
        """The machine code, for vectors of this width."""
        with self._making:
            return self._known_code(width) or self._make_code(width)

    def has_code(self, width: int) -> bool:
        """Whether `code` takes no tracing and no compiling."""
        with self._making:
            return self._known_code(width) is not None

    def device_text(self, threads: int = THREADS, blocks: int = BLOCKS) -> str:
        """The program as LLVM's text for devices; see `device_target`."""
        graph = self.graph
        with long_trace():
            return kernel_text(graph, device_target(threads, blocks))

    def ptx(self, architecture: Architecture) -> str:
        """The program as PTX for a kind of device."""
        with self._making:
            if self._known_ptx(architecture) is None:
                text = self._ptx[architecture.name] = ptx_text(self.device_text(), architecture)
                self._write(architecture.name, text)
            return self._ptx[architecture.name]

    def has_ptx(self, architecture: Architecture) -> bool:
        """Whether `ptx` takes no tracing and no compiling."""
        with self._making:
            return self._known_ptx(architecture) is not None

    def _kept_signature(self) -> Signature | None:
        """What the disk knew of it when it was first asked."""
        digest = self.digest
        return self._kept(lambda: None if digest is None else read_object(_KIND, digest, Signature))

    def _sign(self) -> Signature:
        program, graph = self._own_program(), self.graph
        found = Signature(
            inputs=self.inputs,
            outline=self.outline,
            outputs=len(graph.outputs),
            constants=graph.constants,
            row=len(graph.row),
            recorded=len(graph.recorded),
            records=graph.recording is not None,
            maps=any(value.op == "map" for value in graph.body.values),
            long=len(graph.body.values) > _LONG,
            backwards=program.backwards,
        )
        if self.digest is not None:
            write_object(_KIND, self.digest, *found)
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

    def _known_ptx(self, architecture: Architecture) -> str | None:
        name = architecture.name
        return _remembered(self._ptx, name, lambda: self._read(name))

    def _known_code(self, width: int) -> MachineCode | None:
        def read() -> MachineCode | None:
            signature = None if self._traced.done else self._kept_signature()
            name = None if signature is None else self._read(_code_entry(width))
            if name is None or signature is None:
                return None
            return stored_code(name, ENTRY, as_written=signature.maps)

        return _remembered(self._code, width, read)

    def _make_code(self, width: int) -> MachineCode:
        text, maps = self.text(width), self.signature.maps
        code = self._code[width] = machine_code(text, ENTRY, as_written=maps)
        self._write(_code_entry(width), code_name(text, ENTRY, as_written=maps))
        return code

    def _read(self, what: str) -> str | None:
        """A text that the disk keeps of it."""
        kept = None if self.digest is None else read_entry(_KIND, f"{self.digest}-{what}")
        return None if kept is None else kept.decode()

    def _write(self, what: str, text: str) -> None:
        if self.digest is not None:
            write_entry(_KIND, f"{self.digest}-{what}", text.encode())

    def _own_program(self) -> Program:
        if self._program is None:
            raise LookupError(
                "What was kept on disk of a compiled program is gone: jaxbiped.clear_caches(), "
                "and the call compiles it again."
            )
        return self._program


def _code_entry(width: int) -> str:
    return f"{host().cpu}-{host().width}-{width}"


def _remembered(known: dict[Any, _T], key: object, read: Callable[[], _T | None]) -> _T | None:
    """What is known by a key, or else read."""
    found = known.get(key)
    found = read() if found is None else found
    if found is not None:
        known[key] = found
    return found

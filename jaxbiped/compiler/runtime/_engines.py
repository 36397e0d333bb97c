"""Engines: what runs programs. Each tells what it cannot do, and runs what it can.

By lanes programs are machine code, one simulation a lane of a vector or a device's thread.
"""

import abc
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler.ir._lower_jaxpr import UnknownPrimitiveError
from jaxbiped.compiler.runtime._compiled_program import HOST, CompiledProgram
from jaxbiped.compiler.runtime._lane_call import Schedule
from jaxbiped.compiler.runtime._primitive import Recording, call
from jaxbiped.compiler.runtime._processor import AbstractProcessor
from jaxbiped.compiler.runtime._program import Program, Recorded

Shapes: TypeAlias = tuple[tuple[int, ...], ...]


class Request(NamedTuple):
    """A program to run for one simulation, under `vmap` for many, or for a batch.

    Attributes:
        program: what to run. Programs are compared by identity of their functions' owners: who
            asks again should ask with the same one.
        inputs: of one simulation; of a `batch` NumPy's arrays with a leading axis of n.
        room: records that each simulation has room for.
        times: increasing times of the records, shape (m,), where the program has such.
        stream: rows that the program reads: an array (rows, numbers), or the `Recording` or
            `Recorded` of another simulation by the same engine.
        quick: whether a single simulation is over before a user could interrupt.
        batch: whether the inputs are those of n simulations; they are not traced.
        keeps_records: whether records are for another simulation to read; by lanes they stay on
            the host as a `Recording`, which `reads_once` says is read but once.
    """

    program: Program
    inputs: PyTree
    room: int = 0
    times: np.ndarray | None = None
    stream: PyTree = None
    quick: bool = False
    batch: bool = False
    keeps_records: bool = False
    reads_once: bool = False

    def shapes(self) -> tuple[jtu.PyTreeDef, Shapes]:
        """Structure of one simulation's inputs, and the shapes of its leaves. Hashable."""
        leaves, structure = jtu.tree_flatten(self.inputs)
        skipped = 1 if self.batch else 0
        return structure, tuple(np.shape(leaf)[skipped:] for leaf in leaves)


class Result(NamedTuple):
    """Outputs of a request, and its records where the program makes such.

    Attributes:
        outputs: of the program's `finish`; of a batch NumPy's arrays (n, …).
        records: as arrays.
        recording: of records that another simulation may read.
    """

    outputs: PyTree
    records: Recorded | None = None
    recording: Recording | Recorded | None = None


class AbstractEngine(abc.ABC):
    """Runs programs."""

    @abc.abstractmethod
    def can(self, request: Request) -> str | None:
        """None where it can run a request, else the one sentence that says what hinders."""

    @abc.abstractmethod
    def run(self, request: Request) -> Result:
        """Runs a request that it can run, at once or as part of a program of JAX."""


class LaneEngine(AbstractEngine):
    """Compiles a program on its first request. Computes in 64 bits; has no derivatives.

    Attributes:
        processor: what the programs run on.
    """

    def __init__(self, processor: AbstractProcessor = HOST) -> None:
        self.processor = processor

    def can(self, request: Request) -> str | None:
        """None, or that there is no processor, or which operation of the program lanes do not have.

        Traces the program.
        """
        missing = self.processor.hindrance()
        return missing or _hindrance(request.program, *request.shapes(), self.processor)

    def run(self, request: Request) -> Result:
        """See `AbstractEngine.run`.

        Raises:
            UnknownPrimitiveError: the program holds an operation that lanes do not have.
        """
        compiled, inputs = self.compile(request), request.inputs
        how: Any = dict(stream=request.stream, room=request.room, quick=request.quick)
        if request.batch:
            return Result(*compiled.run(inputs, schedule=request.times, **how))
        schedule = None if request.times is None else Schedule(request.times)
        how |= dict(keeps_records=request.keeps_records, reads_once=request.reads_once)
        outputs, found = call(compiled, inputs, schedule, **how)
        if isinstance(found, Recording):
            return Result(outputs, recording=found)
        return Result(outputs, found)

    def compile(self, request: Request) -> CompiledProgram:
        """The compiled program of requests with inputs of these shapes, traced when needed."""
        return _compiled(request.program, *request.shapes(), self.processor)


@bounded_cache(PROGRAMS)
def _compiled(
    program: Program, structure: jtu.PyTreeDef, shapes: Shapes, processor: AbstractProcessor
) -> CompiledProgram:
    leaves = [jax.ShapeDtypeStruct(shape, jnp.float64) for shape in shapes]
    return CompiledProgram.of(program, jtu.tree_unflatten(structure, leaves), processor)


@bounded_cache(PROGRAMS)
def _hindrance(
    program: Program, structure: jtu.PyTreeDef, shapes: Shapes, processor: AbstractProcessor
) -> str | None:
    try:
        _compiled(program, structure, shapes, processor).check()
    except UnknownPrimitiveError as error:
        return str(error)
    return None

"""Engines: what runs programs. Each tells what it cannot do, and runs what it can.

By lanes programs are machine code, one simulation a lane of a vector or a device's thread. By XLA
the same programs are loops, on every device.
"""

import abc
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, PyTree

from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler.ir._lower_jaxpr import UnknownPrimitiveError
from jaxbiped.compiler.runtime._compiled_program import HOST, CompiledProgram
from jaxbiped.compiler.runtime._lane_call import Schedule
from jaxbiped.compiler.runtime._primitive import Recording, call
from jaxbiped.compiler.runtime._processors import AbstractProcessor
from jaxbiped.compiler.runtime._program import Program, Recorded

Shapes: TypeAlias = tuple[tuple[int, ...], ...]
_ROUND = 128
"""Attempted steps after which slots that are over take the next simulations."""
_Loop: TypeAlias = tuple[PyTree, Scalar, Scalar, Scalar, Array | None]
"""What is carried, whether it is over, attempts and records so far, and the array of these."""


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
        compiled, inputs, stream = self.compile(request), request.inputs, request.stream
        if isinstance(stream, Recorded):
            # Rows that are read backwards end with the array.
            empty = stream.room - stream.counts if request.program.backwards else 0
            stream = jnp.roll(jnp.asarray(stream.values), empty, axis=0)
        how: Any = dict(stream=stream, room=request.room, quick=request.quick)
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


class LoopEngine(AbstractEngine):
    """Runs a program in the precision of its inputs, and has forward derivatives.

    Attributes:
        slots: simulations of a batch that are followed at once, always as many: every other
            number compiles anew.
    """

    def __init__(self, slots: int = 1024) -> None:
        self.slots = slots

    def can(self, request: Request) -> str | None:
        """None, or which part of a request only lanes have."""
        if request.program.scheduled and request.times is None:
            return "records at times that are not given are the lanes'"
        if request.batch and (request.room or request.program.stream):
            return "records and streams of a batch are the lanes'"
        return None

    def run(self, request: Request) -> Result:
        if request.batch:
            return Result(_run_batch(request.program, request.inputs, self.slots))
        times = None if request.times is None else jnp.asarray(request.times)
        room = request.room if times is None else len(times)
        outputs, records = _run_one(request.program, request.inputs, request.stream, room, times)
        return Result(outputs, records, records if request.keeps_records else None)


@cached_jit
def _run_one(
    program: Program,
    inputs: PyTree,
    stream: Recorded | Array | None,
    room: int,
    times: Array | None,
) -> tuple[PyTree, Recorded | None]:
    first = program.start(inputs)
    records = None
    if isinstance(stream, jax.Array):
        stream = Recorded(stream, jnp.asarray(len(stream)))  # type: ignore[arg-type]
    if program.record is not None:
        _, row = jax.eval_shape(lambda: _record(program, inputs, first, jnp.inf))
        records = jnp.zeros((room, *row.shape), row.dtype)

    def read(attempts: Scalar) -> tuple[Array, ...]:
        """The row that an attempt reads, if any."""
        if stream is None:
            return ()
        last = jnp.asarray(stream.counts) - 1
        place = jnp.minimum(attempts, last)
        place = last - place if program.backwards else place
        return (jax.lax.dynamic_index_in_dim(jnp.asarray(stream.values), place, keepdims=False),)

    def keep(after: PyTree, count: Scalar, kept: Array) -> tuple[Scalar, Scalar, Array]:
        """Writes the row behind an attempt, if there is one: whether, and how many there are."""
        due = jnp.inf if times is None else times[jnp.minimum(count, room - 1)]
        is_one, row = _record(program, inputs, after, due)
        if times is not None:
            is_one = is_one & (count < room)
        # Where there is none, the place is past the end, and nothing is written.
        kept = kept.at[jnp.where(is_one, count, room)].set(row, mode="drop")
        return is_one, count + is_one.astype(count.dtype), kept

    def advance(loop: _Loop) -> _Loop:
        now, _, attempts, count, kept = loop
        after, over = program.attempt(inputs, now, *read(attempts))
        if kept is not None and times is None:
            _, count, kept = keep(after, count, kept)
        elif kept is not None and room:
            # Several times may be due in one step.
            _, count, kept = jax.lax.while_loop(
                lambda rows: rows[0], lambda rows: keep(after, *rows[1:]), keep(after, count, kept)
            )
        return after, over, attempts + 1, count, kept

    begin = (first, jnp.asarray(False), jnp.asarray(0), jnp.asarray(0), records)
    end, _, _, count, kept = jax.lax.while_loop(lambda loop: ~loop[1], advance, begin)
    recorded = None if kept is None else Recorded(kept, count)  # type: ignore[arg-type]
    return program.finish(inputs, end), recorded


def _record(
    program: Program, inputs: PyTree, now: PyTree, due: Scalar | float
) -> tuple[Scalar, Array]:
    """Whether there is something to record at a time, and its numbers one behind the other."""
    assert program.record is not None
    precision = jnp.result_type(*jtu.tree_leaves(inputs))
    is_one, values = program.record(inputs, now, jnp.asarray(due, precision))
    return is_one, jnp.concatenate([jnp.ravel(value) for value in values])


def _run_batch(program: Program, inputs: PyTree, slots: int) -> PyTree:
    """Runs n simulations; arrays (n, …) in, NumPy's out.

    One that is over waits for the end of its round, not for the longest of the batch: its slot
    then takes the next one from the queue.
    """
    count = int(np.shape(jtu.tree_leaves(inputs)[0])[0])
    owner = np.arange(slots)
    given = _rows(inputs, np.minimum(owner, count - 1))
    owner[count:] = -1
    over = jnp.asarray(owner < 0)
    now = _mapped(program.start, given)
    waiting = min(slots, count)
    found: list[tuple[np.ndarray, PyTree]] = []
    while (owner >= 0).any():
        now, over = _advance(program, given, now, over)
        done = np.flatnonzero(np.asarray(over) & (owner >= 0))
        if not len(done):
            continue
        outputs = jtu.tree_map(np.asarray, _mapped(program.finish, given, now))
        found.append((owner[done], _rows(outputs, done)))
        owner[done] = -1
        fresh = np.arange(waiting, min(waiting + len(done), count))
        waiting += len(fresh)
        if len(fresh):
            places = done[: len(fresh)]
            owner[places] = fresh
            rows, beyond = np.resize(fresh, slots), np.full(slots, slots)
            beyond[: len(places)] = places
            given, now, over = _refill(
                program, given, now, over, jnp.asarray(beyond), _rows(inputs, rows)
            )
    order = np.argsort(np.concatenate([places for places, _ in found]))
    parts = [part for _, part in found]
    return jtu.tree_map(lambda *leaves: np.concatenate(leaves)[order], *parts)


@cached_jit
def _mapped(function: Callable[..., PyTree], *args: PyTree) -> PyTree:
    return jax.vmap(function)(*args)


@cached_jit
def _advance(program: Program, inputs: PyTree, now: PyTree, over: Array) -> tuple[PyTree, Array]:
    """At most so many attempts further; what is over stays as it is."""
    attempt = jax.vmap(program.attempt)

    def going(loop: tuple[PyTree, Array, Scalar]) -> Scalar:
        _, over, attempts = loop
        return (attempts < _ROUND) & ~jnp.all(over)

    def onward(loop: tuple[PyTree, Array, Scalar]) -> tuple[PyTree, Array, Scalar]:
        now, over, attempts = loop
        after, ended = attempt(inputs, now)
        kept = jtu.tree_map(lambda old, new: jnp.where(over, old, new), now, after)
        return kept, over | ended, attempts + 1

    now, over, _ = jax.lax.while_loop(going, onward, (now, over, jnp.asarray(0)))
    return now, over


@cached_jit
def _refill(
    program: Program, given: PyTree, now: PyTree, over: Array, places: Array, fresh: PyTree
) -> tuple[PyTree, PyTree, Array]:
    """The simulations at these places replaced; a place beyond the slots takes none."""
    begun = jax.vmap(program.start)(fresh)

    def put(old: Array, new: Array) -> Array:
        return old.at[places].set(new, mode="drop")

    given, now = jtu.tree_map(put, given, fresh), jtu.tree_map(put, now, begun)
    return given, now, over.at[places].set(False, mode="drop")


def _rows(tree: PyTree, rows: np.ndarray) -> PyTree:
    return jtu.tree_map(lambda leaf: leaf[rows], tree)

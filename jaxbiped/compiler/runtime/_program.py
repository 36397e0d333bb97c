"""Program of a simulation: four functions of JAX, their graph, and what they record.

Also how many operations one call of a function takes in a lane.
"""

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._jax_versions import without_switches
from jaxbiped._types import Numbers, Scalar
from jaxbiped.compiler.ir._graph import Block, Kind, Value
from jaxbiped.compiler.ir._liveness import Liveness, sink_code
from jaxbiped.compiler.ir._lower_jaxpr import lower_jaxpr
from jaxbiped.compiler.ir._primitives import (
    KINDS,
    Array,
    array_of,
    convert,
    match_kinds,
)

_NO_WORK = ("input", "const", "part", "held", "taken")


@dataclasses.dataclass(frozen=True)
class Program:
    """What every lane does, from taking a simulation to giving it back.

    Leaves of inputs, of what is carried and of outputs are numbers or arrays of static shape.

    Attributes:
        start: what is carried at first, `start(inputs)`.
        attempt: one attempted step, `attempt(inputs, carried)`, gives what is then carried and
            whether the simulation is over (boolean).
        stream: numbers in each row of an input stream, of which every attempt reads the next row
            as a third argument, shape (stream,); behind the last row that one again. 0: none.
        backwards: whether a stream is read from its last row on.
        finish: outputs, `finish(inputs, carried)`.
        record: `record(inputs, carried, next_time)` gives whether there is something to record
            (boolean) and what, a list of numbers. It is asked until it has nothing more where
            `scheduled`, else once after each attempt. None: nothing is recorded.
        scheduled: whether records are made at times of a schedule, the next of which it is given.
    """

    start: Callable[[PyTree], PyTree]
    attempt: Callable[..., tuple[PyTree, Scalar]]
    finish: Callable[[PyTree, PyTree], PyTree]
    record: Callable[[PyTree, PyTree, Scalar], tuple[Scalar, Sequence[Scalar]]] | None = None
    scheduled: bool = False
    stream: int = 0
    backwards: bool = False


class Outline(NamedTuple):
    """What leaves a program, known before its operations are.

    Attributes:
        outputs: pytree of outputs, with shapes and dtypes.
        recorded: how many numbers are in a record; None where nothing is recorded.
    """

    outputs: PyTree
    recorded: int | None


class Graph(NamedTuple):
    """A program's operations.

    Attributes:
        prepare: what depends on a simulation's inputs alone.
        begin, body, end, notes: blocks of `start`, `attempt`, `finish` and `record`.
        inputs: what is read, `carried` what is carried, one array for each leaf.
        first: what is carried at first; `following` after an attempt.
        row: of the stream.
        done: whether the simulation is over.
        outputs: 64-bit floating-point numbers, all; `constants` those that are always the same, by
            their places, which `outputs` leaves out.
        next_time: of the schedule. `recording`, `recorded`: see `Program.record`.
    """

    prepare: Block
    begin: Block
    body: Block
    end: Block
    notes: Block
    inputs: list[Value]
    carried: list[Array]
    first: list[Array]
    following: list[Array]
    row: list[Value]
    done: Value
    outputs: list[Value]
    constants: dict[int, float]
    next_time: Value
    recording: Value | None
    recorded: list[Value]
    scheduled: bool

    def results(self) -> list[Value]:
        """All that its operations are for."""
        carried = [v for group in (self.first, self.following) for a in group for v in a.ravel()]
        notes = [] if self.recording is None else [self.recording, *self.recorded]
        return [*carried, self.done, *self.outputs, *notes]


@without_switches
def outline_of(program: Program, inputs: PyTree) -> Outline:
    """Of a program for inputs of these shapes and dtypes."""
    carried = jax.eval_shape(program.start, inputs)
    outputs = jax.eval_shape(program.finish, inputs, carried)
    if program.record is None:
        return Outline(outputs, None)
    time = jax.ShapeDtypeStruct((), jnp.float64)
    _, values = jax.eval_shape(program.record, inputs, carried, time)
    return Outline(outputs, sum(int(np.prod(value.shape)) for value in values))


@without_switches
def graph_of(program: Program, inputs: PyTree) -> Graph:
    """Traces a program for inputs of these shapes and dtypes."""
    prepare = Block(invariant=True)
    begin, body, end = Block(prepare), Block(prepare), Block(prepare)
    notes = Block(prepare)
    given = [inputs_of(prepare, leaf) for leaf in jtu.tree_leaves(inputs)]
    carried_shape = jax.eval_shape(program.start, inputs)
    carried = [inputs_of(body, leaf) for leaf in jtu.tree_leaves(carried_shape)]
    first = lower_function(begin, program.start, (inputs,), given)
    shapes: tuple[PyTree, ...] = (inputs, carried_shape)
    arguments = [*given, *carried]
    row: list[Value] = []
    if program.stream:
        shape = jax.ShapeDtypeStruct((program.stream,), jnp.float64)
        shapes, arguments = (*shapes, shape), [*arguments, inputs_of(body, shape)]
        row = list(arguments[-1])
    following = lower_function(body, program.attempt, shapes, arguments)
    finals = lower_function(end, program.finish, (inputs, carried_shape), [*given, *carried])
    next_time = Value("input", (), Kind.F64, notes)
    recording, recorded = None, []
    if program.record is not None:
        time = jax.ShapeDtypeStruct((), jnp.float64)
        arguments = [*given, *carried, array_of([next_time], ())]
        mask, *values = lower_function(
            notes, program.record, (inputs, carried_shape, time), arguments
        )
        recording = mask.item()
        recorded = [convert(notes, v, Kind.F64) for a in values for v in a.ravel()]
    *following, done = following
    outputs = [convert(end, v, Kind.F64) for array in finals for v in array.ravel()]
    graph = Graph(
        prepare=prepare,
        begin=begin,
        body=body,
        end=end,
        notes=notes,
        inputs=[v for array in given for v in array.ravel()],
        carried=carried,
        first=match_kinds(begin, first, carried),
        following=match_kinds(body, following, carried),
        row=row,
        done=done.item(),
        outputs=[v for v in outputs if v.constant is None],
        constants={i: v.constant for i, v in enumerate(outputs) if v.constant is not None},
        next_time=next_time,
        recording=recording,
        recorded=recorded,
        scheduled=program.scheduled,
    )
    sink_code(graph.results())
    return graph


def outputs_of(shapes: PyTree, table: Numbers, convert: Callable[[Any, np.dtype], Any]) -> PyTree:
    """A table of outputs (numbers, …) cut into arrays (*shape, …), converted to their dtypes."""
    leaves, place = [], 0
    for leaf in jtu.tree_leaves(shapes):
        size = int(np.prod(leaf.shape))
        part = table[place : place + size].reshape((*leaf.shape, *table.shape[1:]))
        leaves.append(convert(part, leaf.dtype))
        place += size
    return jtu.tree_unflatten(jtu.tree_structure(shapes), leaves)


def inputs_of(block: Block, leaf: jax.ShapeDtypeStruct | jax.Array) -> Array:
    """What is read of one leaf, as values of a block."""
    kind = KINDS[np.dtype(leaf.dtype)]
    shape = np.shape(leaf)
    return array_of([Value("input", (), kind, block) for _ in range(int(np.prod(shape)))], shape)


def lower_function(
    block: Block, function: Callable[..., PyTree], shapes: tuple[PyTree, ...], arrays: list[Array]
) -> list[Array]:
    """A function's operations added to a block: its results."""
    closed = jax.make_jaxpr(function)(*shapes)
    found = lower_jaxpr(block, closed.jaxpr, closed.consts, arrays)
    block.forget_calls()
    return found


class Recorded(NamedTuple):
    """What was recorded of n simulations.

    Attributes:
        values: shape (n, room, numbers in a record). Beyond the records there are NaN where a
            schedule says when they are due, else zeros: memory that nobody ever touched.
        counts: how many records there were, shape (n,); more than `room` are lost.
    """

    values: np.ndarray
    counts: np.ndarray

    @property
    def room(self) -> int:
        """For how many records there was room."""
        return int(self.values.shape[-2])

    def columns(self, first: Numbers) -> list[jax.Array]:
        """Of one simulation, as `Recording.columns`."""
        known = jnp.arange(self.room) < self.counts
        rows = jnp.where(known[:, None], self.values, jnp.nan)
        return list(jnp.concatenate([jnp.asarray(first)[None], rows]).T)


def count_operations(
    function: Callable[[PyTree, PyTree], PyTree], varying: PyTree, invariant: PyTree
) -> dict[str, int]:
    """Operations of `function(varying, invariant)` by name, most frequent first.

    What depends on `invariant` alone is left out. Leaves are replaced by numbers.
    """
    number = jax.ShapeDtypeStruct((), jnp.float64)
    shapes = jtu.tree_map(lambda _: number, (varying, invariant))
    once = Block(invariant=True)
    every = Block(once)
    arrays = [inputs_of(every, number) for _ in jtu.tree_leaves(varying)]
    parameters = [inputs_of(once, number) for _ in jtu.tree_leaves(invariant)]
    results = lower_function(every, function, shapes, [*arrays, *parameters])
    needed = Liveness([value for array in results for value in array.ravel()])
    counts: Counter[str] = Counter()
    _count(counts, every, needed)
    return dict(counts.most_common())


def _count(counts: Counter[str], block: Block, needed: Liveness) -> None:
    for value in block.values:
        if value in needed and value.op not in _NO_WORK:
            counts[value.op] += 1
        lists = [arg for arg in value.args if isinstance(arg, list | tuple)]
        inside = [v for each in lists for v in each if isinstance(v, Value)]
        for inner in (arg for arg in value.args if isinstance(arg, Block)):
            _count(counts, inner, Liveness(inside))

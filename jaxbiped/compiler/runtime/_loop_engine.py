"""Loop engine: the same programs as loops that XLA compiles, on every device."""

from functools import partial
from typing import TypeAlias

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, PyTree

from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler.runtime._engines import AbstractEngine, Request, Result
from jaxbiped.compiler.runtime._program import Program, Recorded

_ROUND = 128
"""Attempted steps after which slots that are over take the next simulations."""
_Loop: TypeAlias = tuple[PyTree, Scalar, Scalar, Scalar, Array | None]
"""What is carried, whether it is over, attempts and records so far, and the array of these."""


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
        if request.times is not None or request.program.scheduled:
            return "records at given times are the lanes'"
        if request.batch and (request.room or request.program.stream):
            return "records and streams of a batch are the lanes'"
        return None

    def run(self, request: Request) -> Result:
        """See `AbstractEngine.run`."""
        if request.batch:
            return Result(_run_batch(request.program, request.inputs, self.slots))
        outputs, records = _run_one(request.program, request.inputs, request.stream, request.room)
        return Result(outputs, records, records if request.keeps_records else None)


@cached_jit
def _run_one(
    program: Program, inputs: PyTree, stream: Recorded | Array | None, room: int
) -> tuple[PyTree, Recorded | None]:
    first = program.start(inputs)
    never = jnp.asarray(jnp.inf)
    records = None
    if isinstance(stream, jax.Array):
        stream = Recorded(stream, jnp.asarray(len(stream)))  # type: ignore[arg-type]
    if program.record is not None:
        _, row = jax.eval_shape(partial(_record, program), inputs, first, never)
        records = jnp.zeros((room, *row.shape), row.dtype)

    def read(attempts: Scalar) -> tuple[Array, ...]:
        """The row that an attempt reads, if any."""
        if stream is None:
            return ()
        last = jnp.asarray(stream.counts) - 1
        place = jnp.minimum(attempts, last)
        place = last - place if program.backwards else place
        return (jax.lax.dynamic_index_in_dim(jnp.asarray(stream.values), place, keepdims=False),)

    def advance(loop: _Loop) -> _Loop:
        now, _, attempts, count, kept = loop
        after, over = program.attempt(inputs, now, *read(attempts))
        if kept is not None:
            is_one, row = _record(program, inputs, after, never)
            # Where there is none, the place is past the end, and nothing is written.
            kept = kept.at[jnp.where(is_one, count, room)].set(row, mode="drop")
            count = count + is_one.astype(count.dtype)
        return after, over, attempts + 1, count, kept

    begin = (first, jnp.asarray(False), jnp.asarray(0), jnp.asarray(0), records)
    end, _, _, count, kept = jax.lax.while_loop(lambda loop: ~loop[1], advance, begin)
    recorded = None if kept is None else Recorded(kept, count)  # type: ignore[arg-type]
    return program.finish(inputs, end), recorded


def _record(
    program: Program, inputs: PyTree, now: PyTree, next_time: Scalar
) -> tuple[Scalar, Array]:
    """Whether there is something to record, and its numbers one behind the other."""
    assert program.record is not None
    is_one, values = program.record(inputs, now, next_time)
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
    now = _begin(program, given)
    waiting = min(slots, count)
    found: list[tuple[np.ndarray, PyTree]] = []
    while (owner >= 0).any():
        now, over = _advance(program, given, now, over)
        done = np.flatnonzero(np.asarray(over) & (owner >= 0))
        if not len(done):
            continue
        outputs = jtu.tree_map(np.asarray, _finish(program, given, now))
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
def _begin(program: Program, inputs: PyTree) -> PyTree:
    return jax.vmap(program.start)(inputs)


@cached_jit
def _finish(program: Program, inputs: PyTree, now: PyTree) -> PyTree:
    return jax.vmap(program.finish)(inputs, now)


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

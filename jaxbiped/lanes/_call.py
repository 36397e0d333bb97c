"""Compiled programs as operations of JAX: they run under `jit` and `vmap`."""

from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array, PyTree

from jaxbiped.lanes._engine import CompiledProgram, Recorded
from jaxbiped.lanes._program import leaves_of


class Schedule:
    """Times of records, the same for every simulation. Compared by identity."""

    def __init__(self, times: np.ndarray) -> None:
        self.times = np.ascontiguousarray(times, dtype=np.float64)


def call(
    compiled: CompiledProgram,
    inputs: PyTree,
    schedule: Schedule | None = None,
    *,
    tape: Any = None,
    room: int = 0,
    quick: bool = False,
) -> tuple[PyTree, Recorded | None]:
    """Runs one simulation, or under `vmap` many at once, each in a lane.

    There is room for `room` records, or for one at each time of a schedule. A `tape`, shape
    (rows, numbers), is for programs that read one.

    It has no derivative of its own. Outside of `jit` it runs at once and an
    interrupt ends it; inside, it is called back from the compiled program, and an interrupt waits.
    A single simulation that is `quick` is over before a user could interrupt, and needs no thread.
    """
    leaves = jtu.tree_leaves(inputs)
    params: dict[str, Any] = dict(compiled=compiled, schedule=schedule, room=room, quick=quick)
    # One array each way: every array that crosses costs time.
    rows = [] if tape is None else [tape]
    if any(isinstance(leaf, jax.core.Tracer) for leaf in [*leaves, *rows]):
        numbers = [jnp.ravel(jnp.asarray(leaf, dtype=jnp.float64)) for leaf in leaves]
        given = [jnp.concatenate(numbers), *rows]
        table, *rest = (leaf[0] for leaf in _RUN.bind(*[x[None] for x in given], **params))
    else:
        known = [np.ravel(np.asarray(leaf, dtype=np.float64)) for leaf in leaves]
        given = [np.concatenate(known), *(np.asarray(x) for x in rows)]
        table, *rest = (leaf[0] for leaf in _run(*[x[None] for x in given], **params))
    records: Any = [jnp.asarray(leaf) for leaf in rest]
    recorded = Recorded(*records) if rest else None
    return _outputs(compiled, table), recorded


def _outputs(compiled: CompiledProgram, table: Any) -> PyTree:
    shapes, structure = jtu.tree_flatten(compiled.graph.output_structure)
    parts = leaves_of(compiled.graph.output_structure, table)
    leaves = [jnp.asarray(part.astype(s.dtype)) for part, s in zip(parts, shapes, strict=True)]
    return jtu.tree_unflatten(structure, leaves)


def _run(
    numbers: Any,
    tape: Any = None,
    *,
    compiled: CompiledProgram,
    schedule: Schedule | None,
    room: int,
    quick: bool,
) -> list[np.ndarray]:
    """Of inputs (n, k) and their tapes: outputs (n, o), and what was recorded."""
    times = None if schedule is None else schedule.times
    room = room if times is None else len(times)
    table = np.asarray(numbers).T
    alone = quick and table.shape[1] == 1
    rows = None if tape is None else np.asarray(tape)
    found, recorded = compiled.run_table(table, schedule=times, tape=rows, room=room, quick=alone)
    return [found.T, *(recorded or ())]


def _shapes(
    count: int, *, compiled: CompiledProgram, schedule: Schedule | None, room: int, quick: bool
) -> list[Any]:
    del quick
    leaves = jtu.tree_leaves(compiled.graph.output_structure)
    size = sum(int(np.prod(leaf.shape)) for leaf in leaves)
    found = [jax.ShapeDtypeStruct((count, size), jnp.float64)]
    if compiled.graph.recording is not None:
        room = room if schedule is None else len(schedule.times)
        shape = (count, room, len(compiled.graph.recorded))
        found.append(jax.ShapeDtypeStruct(shape, jnp.float64))
        found.append(jax.ShapeDtypeStruct((count,), jnp.int64))
    return found


def _implemented(*leaves: Any, **params: Any) -> list[Array]:
    return [jnp.asarray(leaf) for leaf in _run(*leaves, **params)]


def _abstract(*leaves: Any, **params: Any) -> list[Any]:
    shapes = _shapes(leaves[0].shape[0], **params)
    return [jax.core.ShapedArray(shape.shape, shape.dtype) for shape in shapes]


def _lowered(context: Any, *operands: Any, **params: Any) -> Any:
    """A call back from the compiled program, with arrays of NumPy.

    `jax.pure_callback` would make arrays of JAX of them, which copies, and where they are large
    waits for a thread of the same pool that this call holds: for ever, on few cores.
    """

    def run(*given: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(_run(*given, **params))

    # While XLA compiles the rest, this compiles as well.
    params["compiled"].make_ready(context.avals_in[0].shape[0])
    results, _, _ = mlir.emit_python_callback(
        context,
        run,
        None,
        list(operands),
        context.avals_in,
        context.avals_out,
        has_side_effect=False,
        returns_token=False,
    )
    return results


def _differentiated(primals: Any, tangents: Any, **params: Any) -> Any:
    raise TypeError(
        'JAX cannot differentiate what the lane engine computes here: use engine="xla", or a '
        "function that brings its own derivatives, such as gait_measures."
    )


def _batched(leaves: Any, axes: Any, **params: Any) -> tuple[list[Array], list[int]]:
    size = next(
        leaf.shape[axis] for leaf, axis in zip(leaves, axes, strict=True) if axis is not None
    )
    aligned = [
        jnp.broadcast_to(leaf, (size, *leaf.shape)) if axis is None else jnp.moveaxis(leaf, axis, 0)
        for leaf, axis in zip(leaves, axes, strict=True)
    ]
    count = aligned[0].shape[1]
    merged = [leaf.reshape(size * count, *leaf.shape[2:]) for leaf in aligned]
    found = _RUN.bind(*merged, **params)
    return [leaf.reshape(size, count, *leaf.shape[1:]) for leaf in found], [0] * len(found)


_RUN = Primitive("lanes")
_RUN.multiple_results = True
_RUN.def_impl(_implemented)
_RUN.def_abstract_eval(_abstract)
ad.primitive_jvps[_RUN] = _differentiated
batching.primitive_batchers[_RUN] = _batched
mlir.register_lowering(_RUN, _lowered)

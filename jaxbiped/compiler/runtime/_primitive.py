"""Compiled programs as a primitive of JAX: they run under `jit` and `vmap`."""

import contextlib
import contextvars
import itertools
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array, PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._host_call import host_call, lower_host_call
from jaxbiped._types import Numbers, as_array
from jaxbiped.compiler.host_code._host_jit import register_rule
from jaxbiped.compiler.host_code._host_writer import HostWriter, Operation, Value, listed
from jaxbiped.compiler.runtime._compiled_program import CompiledProgram
from jaxbiped.compiler.runtime._lane_call import LaneCall, LaneRun, Part, Schedule
from jaxbiped.compiler.runtime._program import Recorded, outputs_of

_UNTRACED: contextvars.ContextVar[list[CompiledProgram] | None] = contextvars.ContextVar(
    "programs that may not be expressible", default=None
)


@contextlib.contextmanager
def deferred_checks() -> Iterator[list[CompiledProgram]]:
    """Within, nothing that is lowered waits until its programs are traced.

    They are listed: whoever goes on to run them first has to `check` each.
    """
    programs: list[CompiledProgram] = []
    token = _UNTRACED.set(programs)
    try:
        yield programs
    finally:
        _UNTRACED.reset(token)


class Recording(eqx.Module):
    """The records of one simulation, told by its inputs: arrays of them travel nowhere.

    Attributes:
        numbers: the inputs' leaves one behind the other, and then those of what was read, (k,).
        how: it was run.
    """

    numbers: Numbers
    how: LaneRun = eqx.field(static=True)

    @property
    def room(self) -> int:
        """For how many records there was room."""
        return self.how.room

    def columns(self, first: Numbers) -> list[Array]:
        """For each of the first k numbers `first`'s and then those recorded, NaN beyond the last.

        `first` has shape (k,), the arrays (1 + room,).
        """
        return _bind([self.numbers, first], self.how, Part.COLUMNS)


def call(
    compiled: CompiledProgram,
    inputs: PyTree,
    schedule: Schedule | None = None,
    *,
    stream: PyTree = None,
    room: int = 0,
    quick: bool = False,
    keeps_records: bool = False,
    reads_once: bool = False,
) -> tuple[PyTree, Recorded | Recording | None]:
    """Runs one simulation, or under `vmap` many at once, each in a lane.

    There is room for `room` records, or for one at each time of a schedule. A `stream`, shape
    (rows, numbers) or the `Recording` of another simulation, is for programs that read one. Where
    it `keeps_records`, they stay on the host; not for longer where one `reads_once`.

    It has no derivative of its own. Outside of `jit` it runs at once and an
    interrupt ends it; inside, it is called back from the compiled program, and an interrupt waits.
    A single simulation that is `quick` is over before a user could interrupt, and needs no thread.
    """
    reads, rows = None, [] if stream is None else [stream]
    if isinstance(stream, Recording):
        reads, rows, inputs = stream.how, [], (inputs, stream.numbers)
    numbers = _numbers(inputs)
    how = LaneRun(compiled, room, quick, reads_once, reads, schedule)
    if keeps_records:
        (table,) = _bind([numbers], how, Part.OUTPUTS)
        return _outputs(compiled, table), Recording(numbers, how)
    table, *rest = _bind([numbers, *rows], how, Part.ALL)
    return _outputs(compiled, table), Recorded(*rest) if rest else None


def _numbers(inputs: PyTree) -> Numbers:
    """The leaves one behind the other: every array that crosses costs time."""
    parts: list[Numbers] = []
    for traced, leaves in itertools.groupby(jtu.tree_leaves(inputs), _is_traced):
        if traced:
            # The primitives themselves: under an eager `vmap` each operation is dispatched.
            wide = [jax.lax.convert_element_type(leaf, jnp.float64) for leaf in leaves]
            parts += [jax.lax.reshape(leaf, (leaf.size,)) for leaf in wide]
        else:
            parts.append(np.concatenate([np.ravel(np.asarray(x, np.float64)) for x in leaves]))
    return parts[0] if len(parts) == 1 else jax.lax.concatenate(parts, 0)


def _is_traced(leaf: object) -> bool:
    return isinstance(leaf, jax.core.Tracer)


def _bind(given: list[Numbers], how: LaneRun, wants: Part) -> list[Any]:
    """The operation's results for one simulation."""
    if any(map(_is_traced, given)):
        rows = [jax.lax.expand_dims(x, (0,)) for x in given]
        return [jax.lax.squeeze(leaf, (0,)) for leaf in _RUN.bind(*rows, how=how, wants=wants)]
    found = LaneCall(1, how, wants)(*[np.asarray(x)[None] for x in given])
    return [as_array(leaf[0]) for leaf in found]


def _outputs(compiled: CompiledProgram, table: Array) -> PyTree:
    shapes, convert = compiled.kernel.outline.outputs, jax.lax.convert_element_type
    if not _is_traced(table):
        # By NumPy: JAX would compile a program for each of these.
        own = np.asarray(table)
        return outputs_of(shapes, own, lambda part, dtype: as_array(part.astype(dtype)))
    if all(leaf.ndim == 0 for leaf in jtu.tree_leaves(shapes)):
        # The same as what follows, by one operation.
        numbers = iter(jnp.unstack(table))
        return jtu.tree_map(lambda leaf: convert(next(numbers), leaf.dtype), shapes)
    return outputs_of(shapes, table, convert)


def _implementation(*leaves: Array, how: LaneRun, wants: Part) -> list[Array]:
    return [jnp.asarray(leaf) for leaf in LaneCall(len(leaves[0]), how, wants)(*leaves)]


def _abstract_evaluation(
    *leaves: jax.core.ShapedArray, how: LaneRun, wants: Part
) -> list[jax.core.ShapedArray]:
    count, outline = leaves[0].shape[0], how.compiled.kernel.outline
    if wants is Part.COLUMNS:
        column = jax.core.ShapedArray((count, 1 + how.room), jnp.float64)
        return [column] * leaves[1].shape[1]
    size = sum(int(np.prod(leaf.shape)) for leaf in jtu.tree_leaves(outline.outputs))
    found = [jax.core.ShapedArray((count, size), jnp.float64)]
    if outline.recorded is not None and wants is Part.ALL:
        room = how.room if how.schedule is None else len(how.schedule.times)
        found.append(jax.core.ShapedArray((count, room, outline.recorded), jnp.float64))
        found.append(jax.core.ShapedArray((count,), jnp.int64))
    return found


def _lowering(context: Any, *operands: Any, how: LaneRun, wants: Part) -> Any:
    """A call of the host from the compiled program, with arrays of NumPy.

    `jax.pure_callback` would make arrays of JAX of them, which copies, and where they are large
    waits for a thread of the same pool that this call holds: for ever, on few cores.
    """
    run = _begun_call(context.avals_in[0].shape[0], how, wants)
    if tuple(context.module_context.platforms) == ("cpu",):
        return lower_host_call(context, host_call(run), operands)
    results, _, _ = mlir.emit_python_callback(
        context,
        lambda *given: tuple(run(*map(np.asarray, given))),
        None,
        list(operands),
        context.avals_in,
        context.avals_out,
        has_side_effect=False,
        returns_token=False,
    )
    return results


def _begun_call(count: int, how: LaneRun, wants: Part) -> LaneCall:
    """The call of a program, which is compiled while the rest is."""
    if wants is not Part.COLUMNS:
        compiled, waiting = how.compiled, _UNTRACED.get()
        compiled.make_ready(count)
        if waiting is None:
            compiled.check()
        else:
            waiting.append(compiled)
    return LaneCall(count, how, wants)


def _write_on_host(writer: HostWriter, op: Operation) -> Sequence[Value]:
    """The call in a host program."""
    given = [writer.full(each) for each in op.inputs]
    run = _begun_call(given[0].shape[0], op.params["how"], op.params["wants"])
    name = writer.thing(run, object())
    only = "[0]" if len(op.results()) == 1 else ""
    form = f"{name}({listed(len(given))}){only}"
    return writer.emit_all(form, given, op.results(), computed=False)


def _refuse_derivative(primals: object, tangents: object, **params: object) -> NoReturn:
    raise ArgumentError(
        "Programs of lanes cannot be differentiated: take differences, or first derivatives of a "
        "function that brings its own, such as gait_measures."
    )


def _batching(leaves: Any, axes: Any, **params: Any) -> tuple[list[Array], list[int]]:
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
_RUN.def_impl(_implementation)
_RUN.def_abstract_eval(_abstract_evaluation)
ad.primitive_jvps[_RUN] = _refuse_derivative
batching.primitive_batchers[_RUN] = _batching
mlir.register_lowering(_RUN, _lowering)
register_rule(_RUN.name, _write_on_host)

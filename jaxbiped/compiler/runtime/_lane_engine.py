"""Lane engine: programs as machine code, one simulation a lane of a vector or a device's thread."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._types import Scalar
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler.ir._lower_jaxpr import UnknownPrimitiveError
from jaxbiped.compiler.passes._vertex_elimination import jacobian
from jaxbiped.compiler.runtime._compiled_program import HOST, CompiledProgram
from jaxbiped.compiler.runtime._engine_interface import AbstractEngine, Request, Result, Shapes
from jaxbiped.compiler.runtime._lane_call import Schedule
from jaxbiped.compiler.runtime._primitive import Recording, call
from jaxbiped.compiler.runtime._processor import AbstractProcessor
from jaxbiped.compiler.runtime._program import Program


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

    def jacobian(
        self, function: Callable[[list[Scalar]], list[Scalar]], inputs: Sequence[Scalar]
    ) -> Scalar:
        """By eliminating vertices: fewest operations."""
        return jacobian(function, inputs)

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

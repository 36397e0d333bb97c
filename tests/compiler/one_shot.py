"""Functions run once by lanes, to look at what the emitter makes of them."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped.compiler.runtime._compiled_program import CompiledProgram
from jaxbiped.compiler.runtime._program import Program


def compiled(function, *shapes):
    """A program whose single attempt does nothing and whose output is `function(*inputs)`."""
    inputs = [jax.ShapeDtypeStruct(shape, jnp.float64) for shape in shapes]
    program = Program(
        start=lambda inputs: jnp.zeros(()),
        attempt=lambda inputs, carried: (carried, jnp.asarray(True)),
        finish=lambda inputs, carried: function(*inputs),
    )
    return CompiledProgram.of(program, inputs)


def evaluate(function, *columns, **options):
    """`function` over columns (n, …), one lane for each entry."""
    columns = [np.asarray(column, dtype=float) for column in columns]
    program = compiled(function, *[column.shape[1:] for column in columns])
    return program.run(columns, **options).outputs

"""Functions run once by lanes, to look at what the emitter makes of them."""

import ctypes

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped.compiler import Program
from jaxbiped.compiler.runtime import _compiled_program, _machine_code
from jaxbiped.compiler.runtime._compiled_program import CompiledProgram
from jaxbiped.compiler.runtime._machine_code import machine_code
from jaxbiped.compiler.runtime._primitive import call

NUMBER = jax.ShapeDtypeStruct((), jnp.float64)


def two_zeros(_):
    """What many programs carry at first."""
    return jnp.zeros(()), jnp.zeros(())


def stepped(attempt, inputs=NUMBER, *, start=lambda inputs: inputs, finish=None, **options):
    """A program that carries its inputs, unless told what, and gives what it carries."""
    finish = (lambda inputs, carried: carried) if finish is None else finish
    return CompiledProgram.of(Program(start, attempt, finish, **options), inputs)


def compiled(function, *shapes):
    """A program whose single attempt does nothing and whose output is `function(*inputs)`."""
    return stepped(
        lambda inputs, carried: (carried, jnp.asarray(True)),
        [jax.ShapeDtypeStruct(shape, jnp.float64) for shape in shapes],
        start=lambda inputs: jnp.zeros(()),
        finish=lambda inputs, carried: function(*inputs),
    )


def evaluate(function, *columns, **options):
    """`function` over columns (n, …), one lane for each entry."""
    columns = [np.asarray(column, dtype=float) for column in columns]
    program = compiled(function, *[column.shape[1:] for column in columns])
    return program.run(columns, **options).outputs


def called(program, inputs, **how):
    """Outputs of a program within a function of JAX's, where it may be batched."""
    return call(program, inputs, **how)[0]


def let_threads_run(monkeypatch, by):
    """Lets programs be run by a function of what `run_in_threads` is given, and of itself."""
    run = _machine_code.run_in_threads
    monkeypatch.setattr(
        _compiled_program, "run_in_threads", lambda *given, **how: by(run, *given, **how)
    )


def count_runs(monkeypatch):
    """Programs, how many simulations each of their runs takes, and its room for records."""
    runs, run_table = [], CompiledProgram.run_table

    def counted(program, table, **options):
        runs.append((program, table.simulations, options.get("room", 0)))
        return run_table(program, table, **options)

    monkeypatch.setattr(CompiledProgram, "run_table", counted)
    return runs


def loaded(text, entry, count):
    """A function of so many numbers in a module of LLVM's, on this machine."""
    code = machine_code(text, entry, as_written=False)
    function = ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * count)(code.address)
    return lambda *numbers, _keep=code: function(*numbers)

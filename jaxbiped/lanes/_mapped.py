"""A function of numbers applied to many of them, by lanes."""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.lanes._call import call
from jaxbiped.lanes._engine import CompiledProgram
from jaxbiped.lanes._program import Program

Numbers = Callable[[Sequence[Scalar]], Sequence[Scalar]]


def mapped(function: Numbers, numbers: Scalar) -> Scalar:
    """`function` of the k entries of `numbers`, as an array; under `vmap` each row has a lane.

    The function is compiled once: it must be hashable, equal for equal work, and hold no arrays.
    """
    found, _ = call(_compiled(function, numbers.shape[0]), numbers, quick=True)
    return found


@functools.lru_cache(maxsize=256)
def _compiled(function: Numbers, count: int) -> CompiledProgram:
    def nothing(inputs: Any) -> Scalar:
        return jnp.zeros(())

    def over(inputs: Any, carried: Scalar) -> tuple[Scalar, Scalar]:
        return carried, jnp.asarray(True)

    def finish(inputs: Any, carried: Scalar) -> Scalar:
        return jnp.stack(list(function([inputs[i] for i in range(count)])))

    shape = jax.ShapeDtypeStruct((count,), jnp.float64)
    return CompiledProgram(Program(nothing, over, finish), shape)

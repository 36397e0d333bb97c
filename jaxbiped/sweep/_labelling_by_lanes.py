"""Labelling by lanes: on every core's vectors, each lane going on to the next start."""

import functools
import threading
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped.compiler import CompiledProgram, Program
from jaxbiped.sweep._labelling_loop import AbstractLabellingLoop, Outcome, Start

_MAKING = threading.Lock()
"""Held while a program is made: of many threads one makes it, the others wait for it."""


def label_by_lanes(loop: AbstractLabellingLoop, starts: Start) -> Outcome:
    """Follows n starts until each is certain; NumPy's arrays (n, …) in and out."""
    leaves, structure = jtu.tree_flatten(starts)
    shapes = tuple(np.shape(leaf)[1:] for leaf in leaves)
    with _MAKING:
        program = _compiled(loop, structure, shapes)
    outcome: Outcome = program.run(starts).outputs
    return outcome


@functools.lru_cache(maxsize=64)
def _compiled(loop: AbstractLabellingLoop, structure: Any, shapes: Any) -> CompiledProgram:
    leaves = [jax.ShapeDtypeStruct(shape, jnp.float64) for shape in shapes]
    program = Program(loop.begin, loop.attempt, loop.finish)
    return CompiledProgram(program, jtu.tree_unflatten(structure, leaves))

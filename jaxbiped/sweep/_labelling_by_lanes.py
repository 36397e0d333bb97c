"""Labelling by lanes: on every core's vectors, each lane going on to the next start."""

from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import CompiledProgram, Program
from jaxbiped.sweep._labelling_loop import AbstractLabellingLoop, Outcome, Start


def label_by_lanes(course: AbstractLabellingLoop, starts: Start) -> Outcome:
    """Follows n starts until each is certain; NumPy's arrays (n, …) in and out."""
    leaves, structure = jtu.tree_flatten(starts)
    shapes = tuple(np.shape(leaf)[1:] for leaf in leaves)
    outcome: Outcome = _compiled(course, structure, shapes).run(starts).outputs
    return outcome


@bounded_cache(PROGRAMS)
def _compiled(course: AbstractLabellingLoop, structure: Any, shapes: Any) -> CompiledProgram:
    leaves = [jax.ShapeDtypeStruct(shape, jnp.float64) for shape in shapes]
    program = Program(course.begin, course.attempt, course.finish)
    return CompiledProgram(program, jtu.tree_unflatten(structure, leaves))

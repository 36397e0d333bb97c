"""Solves to a section by lanes, with derivatives."""

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.compiler import Recorded, Recording
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._solve_to_section import Nodes, SectionArrival
from jaxbiped.variational._tangents import Seeded, Tangents
from jaxbiped.variational._variational_solve import solve_variational
from jaxbiped.variational._variational_types import VariationalSolution
from jaxbiped.variational._watch import Watch


def solve_to_section_by_lanes(
    watch: Watch,
    solver: AbstractRosenbrock,
    y0: Tangents,
    args: Seeded,
    sizes: Scalar,
    *,
    precision: Precision,
    max_time: Time,
    max_solver_steps: int,
    carries_parameters: Scalar | bool,
) -> SectionArrival:
    """`solve_to_section` for columns as `solve_variational` takes them; nodes are a `Recording`."""
    found, recording = solve_variational(
        watch,
        solver,
        y0,
        args,
        sizes,
        precision=precision,
        max_time=max_time,
        max_solver_steps=max_solver_steps,
        carries_parameters=carries_parameters,
        save_nodes=True,
    )
    return SectionArrival(
        y=Tangents(found.state, found.columns.T),
        time=found.t,
        time_columns=found.time_columns,
        code=found.code,
        peak=found.peak,
        peak_columns=found.peak_columns,
        jumps=found.jumps,
        missed=jnp.asarray(False),  # its columns meet at every switch
        grazes=found.grazes,
        attempted=found.attempted,
        nodes=None if recording is None else _nodes(y0.state, found, recording),
    )


def _nodes(start: PyTree, found: VariationalSolution, recording: Recording | Recorded) -> Nodes:
    first = jnp.stack([jnp.zeros(()), *jtu.tree_leaves(start)])
    last = jnp.stack([found.t, *jtu.tree_leaves(found.state)])
    return Nodes(first, recording, last, found.accepted)

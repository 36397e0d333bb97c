"""Passages to a section, with derivatives, by lanes."""

from typing import Any

import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._types import Scalar
from jaxbiped.lanes._crossing import cross
from jaxbiped.solve._columns import Seeded, Tangents
from jaxbiped.solve._landing import Watch
from jaxbiped.solve._passage import Passage, Precision
from jaxbiped.solve._rosenbrock import AbstractRosenbrock


def passage_by_lanes(
    watch: Watch,
    solver: AbstractRosenbrock,
    y0: Tangents,
    args: Seeded,
    sizes: Scalar,
    *,
    precision: Precision,
    time_limit: Any,
    max_solver_steps: int,
) -> Passage:
    """`passage` with the nodes saved, for columns as `cross` takes them."""
    found, recorded = cross(
        watch,
        solver,
        y0,
        args,
        sizes,
        precision=precision,
        time_limit=time_limit,
        max_solver_steps=max_solver_steps,
        save_nodes=True,
    )
    assert recorded is not None
    return Passage(
        y=Tangents(found.state, found.columns.T),
        time=found.t,
        time_columns=found.time_columns,
        code=found.code,
        peak=found.peak,
        peak_columns=found.peak_columns,
        jumps=found.jumps,
        missed=found.missed,
        attempted=found.attempted,
        nodes=_nodes(y0.state, recorded),
    )


def _nodes(start: Any, recorded: Any) -> tuple[Any, Any]:
    """Times and states at the ends of the steps, the start first; infinite beyond the last."""
    rows, structure = jtu.tree_flatten(start)
    first = jnp.stack([jnp.zeros(()), *rows])
    reached = jnp.arange(recorded.values.shape[0]) < recorded.counts
    values = jnp.where(reached[:, None], recorded.values, jnp.inf)
    every = jnp.concatenate([first[None], values])
    states = [every[:, 1 + i] for i in range(len(rows))]
    return every[:, 0], jtu.tree_unflatten(structure, states)

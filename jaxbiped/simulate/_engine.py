"""Which engine runs a simulation."""

from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped.solve._engine import engine_for
from jaxbiped.solve._rosenbrock import AbstractRosenbrock


def chosen_engine(
    engine: str, *, solver: Any, save_steps: bool, adjoint: Any, leaves: Any, times: Any
) -> str:
    """The engine that "auto" stands for, or the one that is asked for.

    Raises:
        ArgumentError: an unknown name, or lanes for what they cannot do.
    """
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in jtu.tree_leaves(leaves))
    obstacle = _obstacle(solver, save_steps, adjoint, leaves, times)
    return engine_for(engine, obstacle=obstacle, prefers_xla=traced)


def _obstacle(solver: Any, save_steps: bool, adjoint: Any, leaves: Any, times: Any) -> str | None:
    """Why lanes cannot do what is asked."""
    if not isinstance(solver, AbstractRosenbrock):
        return f"{type(solver).__name__} is not one of its solvers (rodas3p to rodas5p)"
    if save_steps:
        return 'it does not save every step (save="steps")'
    if adjoint is not None:
        return "an adjoint is diffrax's"
    if isinstance(times, jax.core.Tracer):
        return "the times to save at must be known beforehand"
    if any(jnp.result_type(leaf) != jnp.float64 for leaf in jtu.tree_leaves(leaves)):
        return "it computes in 64 bits"
    return None

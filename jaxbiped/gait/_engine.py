"""Choice of the engine that follows the orbits of a search."""

from typing import Any

import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped.solve._engine import engine_for
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock


def orbit_engine(
    engine: str,
    *,
    solver: Any,
    section: Any,
    leaves: Any,
    own_system: bool = False,
    redundant: bool = False,
) -> str:
    """The engine that "auto" stands for, or the one that is asked for.

    Args:
        engine: one of `ENGINES`.
        solver, section: the orbit's.
        leaves: all numbers that are given.
        redundant: whether the motion is solved in redundant coordinates.
        own_system: whether the system is the user's own; nobody knows if lanes can express it.

    Raises:
        ArgumentError: an unknown name, or lanes for what they cannot do.
    """
    obstacle = _hindrance(solver, section, leaves)
    if redundant:
        obstacle = "redundant coordinates are diffrax's"
    return engine_for(engine, obstacle=obstacle, prefers_xla=own_system)


def _hindrance(solver: Any, section: Any, leaves: Any) -> str | None:
    if not isinstance(solver, AbstractRosenbrock):
        return f"{type(solver).__name__} is not one of its solvers (rodas3p to rodas5p)"
    if jtu.tree_leaves(section):
        return f"the section {type(section).__name__} holds numbers of its own"
    if any(jnp.result_type(leaf) != jnp.float64 for leaf in jtu.tree_leaves(leaves)):
        return "it computes in 64 bits"
    return None

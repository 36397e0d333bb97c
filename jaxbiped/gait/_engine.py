"""Choice of the engine that follows the orbits of a search."""

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.gait._gradient_modes import AbstractGradient, Reverse
from jaxbiped.solve._engine_names import engine_for
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._hybrid_system import AbstractSystem


def orbit_engine(
    engine: str,
    *,
    solver: diffrax.AbstractSolver[PyTree],
    section: AbstractSection,
    leaves: PyTree,
    system: AbstractSystem | None = None,
    redundant: bool = False,
) -> str:
    """The engine that "auto" stands for, or the one that is asked for.

    Args:
        engine: one of `ENGINES`.
        solver, section: the orbit's.
        leaves: all numbers that are given.
        redundant: whether the motion is solved in redundant coordinates.
        system: the user's own, where it is: nobody knows if lanes can express it.

    Raises:
        ArgumentError: an unknown name, or lanes for what they cannot do.
    """
    obstacle = _hindrance(solver, section, leaves)
    if redundant:
        obstacle = "redundant coordinates are diffrax's"
    elif holds_arrays(system):
        obstacle = f"the system {type(system).__name__} holds arrays, which belong in args"
    return engine_for(engine, obstacle=obstacle, prefers_xla=system is not None)


def check_holds_none(
    gradient: AbstractGradient, system: AbstractSystem | None, section: AbstractSection
) -> None:
    """Raises `ArgumentError` for reverse mode where a system or section holds arrays."""
    holder = next((each for each in (system, section) if holds_arrays(each)), None)
    if isinstance(gradient, Reverse) and holder is not None:
        raise ArgumentError(
            f"gradient = Reverse() is not allowed here: {type(holder).__name__} holds arrays, "
            "which belong in args."
        )


def holds_arrays(tree: PyTree) -> bool:
    """Whether there are arrays, known or traced, among the leaves."""
    return any(isinstance(leaf, jax.Array | np.ndarray) for leaf in jtu.tree_leaves(tree))


def _hindrance(
    solver: diffrax.AbstractSolver[PyTree], section: AbstractSection, leaves: PyTree
) -> str | None:
    if not isinstance(solver, AbstractRosenbrock):
        return f"{type(solver).__name__} is not one of its solvers (rodas3p to rodas5p)"
    if jtu.tree_leaves(section):
        return f"the section {type(section).__name__} holds numbers of its own"
    if any(jnp.result_type(leaf) != jnp.float64 for leaf in jtu.tree_leaves(leaves)):
        return "it computes in 64 bits"
    return None

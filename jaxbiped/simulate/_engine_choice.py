"""Choice of the engine that runs a simulation."""

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import ArrayLike, PyTree

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.solve._engine_names import ENGINES, engine_for
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock


def choose_engine(
    engine: str,
    *,
    solver: diffrax.AbstractSolver[PyTree],
    save_steps: bool,
    adjoint: diffrax.AbstractAdjoint | None,
    leaves: PyTree,
    times: str | ArrayLike | AbstractSection,
    section: AbstractSection | None,
    dt: ArrayLike | None = None,
    redundant: bool = False,
) -> str:
    """The engine that "auto" stands for, or the one that is asked for.

    Raises:
        ArgumentError: an unknown name, or lanes or CUDA for what they cannot do.
    """
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in jtu.tree_leaves(leaves))
    obstacle = _hindrance(solver, save_steps, adjoint, leaves, times, traced=traced)
    if redundant and not (isinstance(times, str) and times == "end"):
        obstacle = 'redundant coordinates are diffrax\'s, but for save="end"'
    if dt is not None:
        obstacle = "steps of one size (dt) are diffrax's"
    if section is None:
        return engine_for(engine, obstacle=obstacle, prefers_xla=redundant, by_device=True)
    check_choice("engine", engine, ENGINES)
    if engine == "xla" or obstacle is not None:
        why = f"here {obstacle}" if obstacle is not None else 'engine = "xla" was chosen'
        raise ArgumentError(
            f"save = {type(section).__name__}() is not allowed here: only lanes do that, and {why}."
        )
    return engine_for("cuda", obstacle=None, by_device=True) if engine == "cuda" else "lanes"


def _hindrance(
    solver: diffrax.AbstractSolver[PyTree],
    save_steps: bool,
    adjoint: diffrax.AbstractAdjoint | None,
    leaves: PyTree,
    times: str | ArrayLike | AbstractSection,
    *,
    traced: bool,
) -> str | None:
    """Why lanes cannot do what is asked."""
    if not isinstance(solver, AbstractRosenbrock):
        return f"{type(solver).__name__} is not one of its solvers (rodas3p to rodas5p)"
    if save_steps and traced:
        return 'under jit, vmap or derivatives it does not save every step (save="steps")'
    if adjoint is not None:
        return "an adjoint is diffrax's"
    if isinstance(times, jax.core.Tracer):
        return "the times to save at must be known beforehand"
    if isinstance(times, AbstractSection) and jtu.tree_leaves(times):
        return f"the section {type(times).__name__} holds numbers of its own"
    if any(jnp.result_type(leaf) != jnp.float64 for leaf in jtu.tree_leaves(leaves)):
        return "it computes in 64 bits"
    return None

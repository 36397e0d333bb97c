"""Engines by name, and which of them "auto" stands for."""

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped.compiler import BY_NAME, CUDA
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.solve._runge_kutta import stepper_of
from jaxbiped.solve._solvers import SOLVERS
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

ENGINES = ("auto", "xla", "lanes", "cuda")
"""Names of the engines.

- xla: diffrax, compiled by XLA: on every device, for every solver, in every mode of
  differentiation.
- lanes: the same method compiled to vector code for this machine's CPU: many times faster.
- cuda: what lanes run, on this machine's CUDA devices: for walks and labels by the million.
- auto: lanes where JAX computes on a CPU and they can do what is asked, else xla.
  Batches of labels that keep a CUDA device busy, where there is one, are its own.
- an engine of a user's own: by the name that it has in `jaxbiped.compiler.BY_NAME`.
"""


def engine_for(
    engine: str,
    *,
    obstacle: str | None,
    prefers_xla: bool = False,
    by_device: bool = False,
    by_any: bool = False,
) -> str:
    """The engine to use.

    Args:
        engine: one of `ENGINES`.
        obstacle: why lanes, and so devices, cannot do what is asked; None where they can.
        prefers_xla: whether "auto" is "xla" here all the same.
        by_device: whether CUDA devices do such things at all.
        by_any: whether any engine does, a user's own too.

    Raises:
        ArgumentError: an unknown name, or lanes or devices for what they cannot do, or devices
            where there is none.
    """
    own = [name for name in BY_NAME if name not in ENGINES]
    check_choice("engine", engine, (*ENGINES, *own))
    if engine in own and not by_any:
        raise ArgumentError(
            f"engine = {engine!r} is not allowed here: an engine of one's own runs rigid walks and "
            "labels."
        )
    if engine == "cuda":
        _check_device(obstacle, by_device=by_device)
    if engine == "lanes" and obstacle is not None:
        raise ArgumentError(f'engine = "lanes" is not allowed here: {obstacle}; use engine="xla".')
    if engine != "auto":
        return engine
    able = obstacle is None and jax.default_backend() == "cpu"
    return "lanes" if able and not prefers_xla else "xla"


def lane_obstacle(
    solver: diffrax.AbstractSolver[PyTree],
    section: AbstractSection | None,
    leaves: PyTree,
    *,
    columns: bool = False,
) -> str | None:
    """Why lanes cannot solve by a solver, to a section, from these numbers; None where they can.

    `columns`: whether the steps carry derivatives, as those of Rosenbrock methods alone do.
    """
    if columns and not isinstance(solver, AbstractRosenbrock):
        return f"{type(solver).__name__} is not one of its solvers (rodas3p to rodas5p)"
    if stepper_of(solver) is None:
        return f"{type(solver).__name__} is not one of its solvers ({', '.join(SOLVERS)})"
    if section is not None and jtu.tree_leaves(section):
        return f"the section {type(section).__name__} holds numbers of its own"
    if any(jnp.result_type(leaf) != jnp.float64 for leaf in jtu.tree_leaves(leaves)):
        return "it computes in 64 bits"
    return None


def _check_device(obstacle: str | None, *, by_device: bool) -> None:
    """Raises `ArgumentError` unless a CUDA device is there and can do what is asked."""
    why, instead = obstacle, "xla"
    if why is None:
        instead = "lanes"
        why = "CUDA devices run walks and labels, no searches" if not by_device else None
    if why is None:
        why = CUDA.processor.hindrance()
    if why is not None:
        raise ArgumentError(f'engine = "cuda" is not allowed here: {why}; use engine="{instead}".')

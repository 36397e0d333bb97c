"""Derivatives of simulations: the same by every engine, in forward and in reverse mode.

Neither machine code nor steps that were chosen for the state alone can be differentiated as they
are, so a rule is given here.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import PyTree, PyTreeDef

from jaxbiped._caches import PROGRAMS, bounded_cache
from jaxbiped._checks import ArgumentError
from jaxbiped._jax_versions import untraced
from jaxbiped._types import Scalar
from jaxbiped.simulate._slopes import Slopes, slopes_of
from jaxbiped.solve._solvers import solver_named
from jaxbiped.solve._trajectory import Trajectory
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

if TYPE_CHECKING:
    from jaxbiped.simulate._simulation import Simulation


def with_derivatives(
    run: "Simulation", compute: Callable[["Simulation"], Trajectory]
) -> Trajectory:
    """`compute(run)`, with derivatives of the times and states that are saved.

    They come from tangent columns of exactly the leaves that are differentiated, in a solve of
    their own whose steps end at switches; where an event sets the time, they include its motion.
    Where a switch or the event is grazed, they are NaN. An adjoint of diffrax's that the user
    chose is taken instead.
    """
    leaves, structure = jtu.tree_flatten(run)
    if run.adjoint is not None or not _is_traced(leaves):
        return compute(run)
    return _differentiable(compute, structure)(*leaves)


@bounded_cache(PROGRAMS)
def _differentiable(
    compute: Callable[["Simulation"], Trajectory], structure: PyTreeDef
) -> Callable[..., Trajectory]:
    @jax.custom_jvp
    def function(*leaves: Scalar) -> Trajectory:
        return compute(jtu.tree_unflatten(structure, leaves))

    def rule(
        primals: Sequence[Scalar], tangents: Sequence[Scalar | SymbolicZero]
    ) -> tuple[Trajectory, Trajectory]:
        run, dots = (jtu.tree_unflatten(structure, each) for each in (primals, tangents))
        _check_differentiable(run)
        state_dots, scene_dots = _moved(dots.state), _moved(dots.scene)
        clock_dots = _moved(dots.duration if run.times is None else dots.times)
        # What is known is not traced along with the tangents: JAX compiles no small programs.
        known = not _is_traced(primals)
        with untraced() if known else contextlib.nullcontext():
            found = compute(run) if known else function(*primals)
            slopes = slopes_of(
                run.scene,
                run.state,
                found,
                until=run.duration if run.times is None else None,
                solver=_rosenbrock(run),
                section=run.section,
                rtol=run.rtol,
                places=tuple(state_dots),
                active=tuple(scene_dots),
            )
        along = [*state_dots.values(), *scene_dots.values()]
        t_dot, leaf_dots = _contract(slopes, along, *clock_dots.values())
        return found, _tangent_of(found, t_dot, leaf_dots)

    function.defjvp(rule, symbolic_zeros=True)
    return function


def _check_differentiable(run: "Simulation") -> None:
    refused = {
        'save = "steps"': (run.save_steps, 'ask for save="end", an array of times or a section'),
        "extremes": (run.extremes is not None, "only times and states have derivatives"),
        "scene = RedundantScene(…)": (
            run.scene.redundant,
            "the same walk in minimal coordinates, scene.minimal, has them",
        ),
    }
    for argument, (is_so, instead) in refused.items():
        if is_so:
            raise ArgumentError(f"{argument} is not allowed under derivatives: {instead}.")


def _rosenbrock(run: "Simulation") -> AbstractRosenbrock:
    """The method of the columns' steps: the walk's own, where it is one."""
    solver = run.solver if isinstance(run.solver, AbstractRosenbrock) else solver_named("rodas4p")
    assert isinstance(solver, AbstractRosenbrock)
    return solver


@jax.jit
def _contract(
    slopes: Slopes, along: list[Scalar], clock: Scalar | float = 0.0
) -> tuple[Scalar, list[Scalar]]:
    """Tangents of times and leaves, linear in those of the inputs."""
    t_dot = slopes.clock * clock
    leaf_dots = [rate * t_dot for rate in slopes.rates.T]
    if along:
        dots = jnp.stack([jnp.asarray(dot, jnp.float64) for dot in along])
        t_dot = t_dot + slopes.time @ dots
        leaf_dots = [dot + slopes.state[..., i] @ dots for i, dot in enumerate(leaf_dots)]
    return t_dot, leaf_dots


def _tangent_of(found: Trajectory, t_dot: Scalar, leaf_dots: list[Scalar]) -> Trajectory:
    """The tangent of a trajectory, of whose moments those of its arrivals come first."""
    first = len(t_dot) - len(found.t)

    def part(moments: slice) -> tuple[Scalar, PyTree]:
        leaves = [dot[moments] for dot in leaf_dots]
        return t_dot[moments], jtu.tree_unflatten(jtu.tree_structure(found.state), leaves)

    t, state = part(slice(first, None))
    still: Trajectory = jtu.tree_map(_no_tangent, found)
    arrivals = still.arrivals
    if arrivals is not None:
        arrivals = arrivals._replace(t=part(slice(first))[0], state=part(slice(first))[1])
    moving = dataclasses.replace(still, t=t, state=state, arrivals=arrivals)
    return jtu.tree_map(
        lambda dot, leaf: dot.astype(leaf.dtype) if _is_real(leaf) else dot, moving, found
    )


def _moved(dots: PyTree) -> dict[int, Scalar]:
    """Tangents of the leaves that have one, by place."""
    leaves = jtu.tree_leaves(dots, is_leaf=lambda leaf: isinstance(leaf, SymbolicZero))
    return {i: leaf for i, leaf in enumerate(leaves) if not isinstance(leaf, SymbolicZero)}


def _no_tangent(leaf: Scalar) -> Scalar | np.ndarray:
    if _is_real(leaf):
        return jnp.zeros_like(leaf)
    return np.zeros(jnp.shape(leaf), dtype=jax.dtypes.float0)


def _is_real(leaf: Scalar) -> bool:
    return jnp.issubdtype(jnp.result_type(leaf), jnp.inexact)


def _is_traced(leaves: Sequence[object]) -> bool:
    return any(isinstance(leaf, jax.core.Tracer) for leaf in leaves)

"""Derivatives of simulations: the same by every engine, in forward and in reverse mode.

Neither machine code nor steps that were chosen for the state alone can be differentiated as they
are, so a rule is given here.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._jax_versions import unbatched, untraced
from jaxbiped._types import Scalar, is_real, is_traced
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.simulate._slopes import Slopes
from jaxbiped.solve._trajectory import Trajectory

_Run = TypeVar("_Run")
_STILL = object()
"""Tangent of what is known."""


def with_derivatives(
    run: _Run,
    compute: Callable[[_Run], Trajectory[Any]],
    *,
    moving: Callable[[_Run], tuple[PyTree, PyTree, PyTree]],
    slopes: Callable[[_Run, Trajectory[Any], tuple[int, ...], tuple[int, ...]], Slopes],
    check: Callable[[_Run], None] = lambda run: None,
) -> Trajectory[Any]:
    """`compute(run)`, with derivatives of the times and states that are saved.

    Args:
        run: what is simulated.
        compute: simulates it.
        moving: what of it may be differentiated: the start, the scene, and the times at which a
            clock ends or saves it.
        slopes: derivatives of what was found with respect to some leaves of start and scene.
        check: raises `ArgumentError` for what has none, before anything is simulated.
    """
    arrays, rest = eqx.partition(run, eqx.is_array)
    leaves, structure = jtu.tree_flatten(arrays)
    # What is known stays so: the times to save at must be, for lanes.
    traced = [i for i, leaf in enumerate(leaves) if isinstance(leaf, jax.core.Tracer)]
    if not is_traced([unbatched(leaves[i]) for i in traced]):
        return compute(run)

    def filled(others: Sequence[Any], values: Sequence[Any]) -> PyTree:
        every = list(others)
        for i, value in zip(traced, values, strict=True):
            every[i] = value
        return jtu.tree_unflatten(structure, every)

    def whole(values: Sequence[Any]) -> _Run:
        found: _Run = eqx.combine(filled(leaves, values), rest)
        return found

    @jax.custom_jvp
    def function(*leaves: Scalar) -> Trajectory[Any]:
        return compute(whole(leaves))

    def rule(
        primals: Sequence[Scalar], tangents: Sequence[Scalar | SymbolicZero]
    ) -> tuple[Trajectory[Any], Trajectory[Any]]:
        dots = moving(filled([_STILL] * len(leaves), tangents))
        state_dots, scene_dots, clock_dots = map(_moved, dots)
        # What is known is not traced along with the tangents: JAX compiles no small programs.
        known = not is_traced(primals)
        with untraced() if known else contextlib.nullcontext():
            once = whole(primals if known else first_derivatives_only(primals, "a simulation"))
            check(once)
            found = compute(whole(primals)) if known else function(*primals)
            at = slopes(once, found, tuple(state_dots), tuple(scene_dots))
        along = [*state_dots.values(), *scene_dots.values()]
        return found, _tangent_of(found, *_contract(at, along, *clock_dots.values()))

    function.defjvp(rule, symbolic_zeros=True)
    return function(*(leaves[i] for i in traced))


def first_derivatives_only(leaves: PyTree, function: str) -> PyTree:
    """The same numbers, of which there are no derivatives: what has first ones refuses second ones.

    Args:
        leaves: those on which first derivatives depend.
        function: whose they are.
    """

    @jax.custom_jvp
    def once(leaves: PyTree) -> PyTree:
        return leaves

    @once.defjvp
    def refuse(primals: object, tangents: object) -> NoReturn:
        raise ArgumentError(
            f"Second derivatives of {function} are not offered: take differences of first ones."
        )

    return once(leaves)


@cached_jit
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
    if still.mode_history is not None:
        unknown = dataclasses.replace(
            still.mode_history, t=jnp.full_like(still.mode_history.t, jnp.nan)
        )
        moving = dataclasses.replace(moving, mode_history=unknown)
    return jtu.tree_map(
        lambda dot, leaf: dot.astype(leaf.dtype) if is_real(leaf) else dot, moving, found
    )


def _moved(dots: PyTree) -> dict[int, Scalar]:
    """Tangents of the leaves that have one, by place."""
    leaves = jtu.tree_leaves(dots, is_leaf=_is_still)
    return {i: leaf for i, leaf in enumerate(leaves) if not _is_still(leaf)}


def _is_still(dot: object) -> bool:
    return dot is _STILL or isinstance(dot, SymbolicZero)


def _no_tangent(leaf: Scalar) -> Scalar | np.ndarray:
    if is_real(leaf):
        return jnp.zeros_like(leaf)
    return np.zeros(jnp.shape(leaf), dtype=jax.dtypes.float0)

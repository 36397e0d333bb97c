"""Derivatives of simulations: the same by every engine, in forward and in reverse mode.

Neither machine code nor the steps that a controller chose for the state alone can be differentiated
as they are, so a rule is given here.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import PyTree, PyTreeDef

from jaxbiped._caches import PROGRAMS, bounded_cache
from jaxbiped._cached_jit import cached_jit
from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar
from jaxbiped.dynamics._minimal_motion import vector_field
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import exchange_legs
from jaxbiped.dynamics._switches import switches
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._ending_surface import ending_surface
from jaxbiped.solve._solvers import solver_named
from jaxbiped.solve._trajectory import Trajectory
from jaxbiped.solve._units import units_of
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._event_motion import follow_event
from jaxbiped.variational._switch_locator import Watch
from jaxbiped.variational._tangents import Seeded, Tangents
from jaxbiped.variational._tangents_at_times import TangentsAtTimes, tangents_at_times

if TYPE_CHECKING:
    from jaxbiped.simulate._simulation import Simulation

_LOOSER = 10.0
"""Tolerance of derivatives, in units of the state's."""
_WATCH = Watch(field=vector_field, switches=switches)
"""Derivatives are taken up to the times at which the plain solve saved."""


def with_derivatives(
    run: "Simulation", compute: Callable[["Simulation"], Trajectory]
) -> Trajectory:
    """`compute(run)`, with derivatives of the times and states that are saved.

    They come from tangent columns of exactly the leaves that are differentiated, in a solve of
    their own whose steps end at switches; where an event sets the time, they include its motion.
    Where a switch or the event is grazed, they are NaN.
    """
    leaves, structure = jtu.tree_flatten(run)
    if run.adjoint is not None or not any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
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
        found = function(*primals)
        return found, _tangents(run, dots, found)

    function.defjvp(rule, symbolic_zeros=True)
    return function


def _check_differentiable(run: "Simulation") -> None:
    refused = {
        'save = "steps"': (run.save_steps, 'ask for save="end", an array of times or a section'),
        "extremes": (run.extremes is not None, "only times and states have derivatives"),
        "scene = RedundantScene(…)": (
            run.scene.redundant,
            "the same walk in minimal coordinates, scene.minimal, has them, and so has return_map",
        ),
    }
    for argument, (is_so, instead) in refused.items():
        if is_so:
            raise ArgumentError(f"{argument} is not allowed under derivatives: {instead}.")


def _tangents(run: "Simulation", dots: "Simulation", found: Trajectory) -> Trajectory:
    """Derivatives of a trajectory along the tangents of a run, linear in them."""
    moments = [(found.t, found.state)]
    if found.arrivals is not None:
        moments.insert(0, (found.arrivals.t, found.arrivals.state))
    t, state = jtu.tree_map(lambda *parts: jnp.concatenate(parts).astype(jnp.float64), *moments)
    by_clock = jnp.isfinite(t) if run.times is not None else (t >= run.duration)
    clock_dot = dots.duration if run.times is None else dots.times
    clock = jnp.where(by_clock, 0.0 if _is_zero(clock_dot) else clock_dot, 0.0)
    places, active = (_moved(part) for part in (dots.state, dots.scene))
    t_dot, state_dot = clock, [rate * clock for rate in _rates(t, state, run.scene)]
    if places or active:
        slopes = _slopes(run, found, t, by_clock, tuple(places), tuple(active))
        along = jnp.stack([*places.values(), *active.values()]).astype(jnp.float64)
        t_dot = t_dot + slopes.time @ along
        state_dot = [dot + slopes.state[..., i] @ along for i, dot in enumerate(state_dot)]
    still: Trajectory = jtu.tree_map(_zero, found)
    rest, saved = (
        (t_dot[part], jtu.tree_unflatten(jtu.tree_structure(found.state), [x[part] for x in state_dot]))
        for part in (slice(0, len(t) - len(found.t)), slice(len(t) - len(found.t), None))
    )
    arrivals = still.arrivals
    if arrivals is not None:
        arrivals = arrivals._replace(t=rest[0], state=rest[1])
    return jtu.tree_map(
        lambda like, dot: dot if dot.dtype == jax.dtypes.float0 else dot.astype(like.dtype),
        found,
        dataclasses.replace(still, t=saved[0], state=saved[1], arrivals=arrivals),
    )


class _Slopes(NamedTuple):
    """Derivatives at k moments in n directions: of the time, (k, n), and the state, (k, n, c)."""

    time: Scalar
    state: Scalar


def _slopes(
    run: "Simulation",
    found: Trajectory,
    t: Scalar,
    by_clock: Scalar,
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> _Slopes:
    scene, state = jtu.tree_map(lambda leaf: jnp.asarray(leaf, jnp.float64), (run.scene, run.state))
    at = tangents_at_times(
        _WATCH,
        run.solver if isinstance(run.solver, AbstractRosenbrock) else solver_named("rodas4p"),
        scene,
        state,
        times=t,
        places=places,
        active=active,
        precision=Precision(run.rtol, _LOOSER * run.rtol),
    )
    if run.times is not None:
        slopes = _Slopes(jnp.zeros(at.columns.shape[:2]), at.columns)
    else:
        slopes = _at_events(scene, at, found.final, found.ending, run.section, run.rtol, active)
        slopes = _Slopes(
            jnp.where(by_clock[:, None], 0.0, slopes.time),
            jnp.where(by_clock[:, None, None], at.columns, slopes.state),
        )
    return jtu.tree_map(lambda leaf: (leaf.T * jnp.isfinite(t)).T, slopes)


@cached_jit
def _at_events(
    scene: Scene,
    at: TangentsAtTimes,
    end: PyTree,
    ending: Scalar,
    section: AbstractSection | None,
    rtol: Scalar,
    active: tuple[int, ...],
) -> _Slopes:
    """At arrivals at a section, but at last where the simulation ends."""
    p, n = len(active), at.columns.shape[1]
    seeds = jnp.concatenate([jnp.zeros((p, n - p)), jnp.eye(p)], axis=1)
    seeded = Seeded(scene, seeds, jnp.zeros(n), active)
    unit = units_of(scene, end).time

    def slopes(surface: Callable[[PyTree, PyTree], Scalar], here: TangentsAtTimes) -> _Slopes:
        tangents = Tangents(here.state, here.columns.T)
        field = functools.partial(vector_field, 0.0)
        return _Slopes(
            *follow_event(
                surface, lambda a, y: field(y, a), tangents, seeded, rtol=rtol, unit=unit
            )
        )

    def arrival(here: TangentsAtTimes) -> _Slopes:
        def value(a: PyTree, y: PyTree) -> tuple[Scalar, Scalar]:
            assert section is not None
            return section.value(a, y), section.value(a, exchange_legs(y))

        own, other = value(scene, here.state)
        exchanged = jnp.abs(other) < jnp.abs(own)
        return slopes(lambda a, y: jnp.where(exchanged, *value(a, y)[::-1]), here)

    last = slopes(
        lambda a, y: ending_surface(ending, a, end, y), jtu.tree_map(lambda leaf: leaf[-1], at)
    )
    parts = [jtu.tree_map(lambda leaf: leaf[None], last)]
    if section is not None:
        parts.insert(0, jax.vmap(arrival)(jtu.tree_map(lambda leaf: leaf[:-1], at)))
    return jtu.tree_map(lambda *each: jnp.concatenate(each), *parts)


def _rates(t: Scalar, state: PyTree, scene: Scene) -> list[Scalar]:
    """Of the state's leaves at moments that were reached, zero at others."""
    rates = jax.vmap(lambda y: vector_field(0.0, y, scene))(state)
    return [jnp.where(jnp.isfinite(t), rate, 0.0) for rate in jtu.tree_leaves(rates)]


def _moved(dots: PyTree) -> dict[int, Scalar]:
    """Tangents of the leaves that have one, by place."""
    leaves = jtu.tree_leaves(dots, is_leaf=_is_zero)
    return {i: leaf for i, leaf in enumerate(leaves) if not _is_zero(leaf)}


def _is_zero(tangent: object) -> bool:
    return isinstance(tangent, SymbolicZero)


def _zero(leaf: Scalar) -> Scalar:
    if jnp.issubdtype(leaf.dtype, jnp.inexact):
        return jnp.zeros_like(leaf)
    return np.zeros(jnp.shape(leaf), dtype=jax.dtypes.float0)

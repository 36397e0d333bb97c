"""Derivatives of simulations: the same by every engine, in forward and in reverse mode.

Neither machine code nor steps that were chosen for the state alone can be differentiated as they
are, so a rule is given here.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, NoReturn, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped._jax_versions import unbatched, untraced
from jaxbiped._types import Scalar, in_64_bits, is_real, is_traced, select
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import CUDA, host_jit
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._stance_motion import rolling_field
from jaxbiped.dynamics._surfaces import opening, uprightness
from jaxbiped.hybrid._rolling_system import ROLLING
from jaxbiped.hybrid._scales import units_of
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import AbstractScene, RigidScene
from jaxbiped.simulate._trajectory import Trajectory
from jaxbiped.solve._landing_steps import Landing
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas5P
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._tangents import Seeded, Tangents, along_columns, as_columns
from jaxbiped.variational._variational_solve import (
    EventMotion,
    TangentsAtTimes,
    follow_event,
    motion_solve,
    seeded_directions,
    tangents_after,
    tangents_at_times,
)

_EARLY, _LEFT = 3.0, 1e-2
"""How long before an event the motion is first followed, in tolerances times the unit of time, and
the share of that which is left in the end: behind a touchdown derivatives change in nanoseconds."""
_Run = TypeVar("_Run")
_STILL = object()
"""Tangent of what is known."""


class Slopes(NamedTuple):
    """Derivatives at k moments: arrivals at a section, then what was saved.

    Attributes:
        time, state: in n directions, shapes (k, n) and (k, n, c).
        clock: whether the moment is that of a clock, the duration or a time to save at, (k,).
        rates: of the state there, shape (k, c).
    """

    time: Scalar
    state: Scalar
    clock: Scalar
    rates: Scalar


@host_jit(lambda *_, device, **__: not device)
def slopes_of(
    scene: AbstractScene,
    state: PyTree,
    found: Trajectory,
    *,
    until: Scalar | None,
    solver: AbstractRosenbrock,
    section: AbstractSection | None,
    rtol: Scalar,
    places: tuple[int, ...],
    active: tuple[int, ...],
    device: bool,
) -> Slopes:
    """Derivatives of what was `found`, with respect to some leaves of the state and of the scene.

    Args:
        scene, state: what was simulated, and from where.
        found: the result.
        until: the duration, to which all moments but the last are events; None: the times to save
            at were given.
        solver: of the columns.
        section: at which arrivals were saved.
        rtol: relative tolerance of the solve.
        places, active: of the leaves that are differentiated.
        device: whether CUDA devices carry the columns; else it is lanes where they can, else XLA.
    """
    scene, state, saved, t = in_64_bits((scene, state, found.state, found.t))
    system = system_of(scene)
    if found.arrivals is not None:
        t = jnp.concatenate([in_64_bits(found.arrivals.t), t])
    by_clock = jnp.isfinite(t)
    if until is not None:
        last = jnp.arange(len(t)) == len(t) - 1
        by_clock = last & (t >= until)
    arrived = len(t) - len(found.t)
    there = jtu.tree_map(lambda leaf: jnp.pad(leaf, (arrived, 0), mode="edge"), saved)
    at = TangentsAtTimes(there, jnp.zeros((len(t), 0, len(jtu.tree_leaves(there)))))
    time = jnp.zeros((len(t), 0))
    if places or active:
        project = system.project if system.projects(scene) else None
        watch = Watch.of(system, resets=system.resets, project=project)
        how, engine = motion_solve(watch, solver, rtol), CUDA if device else None
        start, seeded = seeded_directions(scene, state, places, active)
        early = _EARLY * rtol * units_of(scene, state).time
        at = tangents_at_times(how, start, seeded, jnp.where(by_clock, t, t - early), engine)
        time = jnp.zeros(at.columns.shape[:2])
    columns = at.columns
    if until is not None and (places or active):
        end = jtu.tree_map(lambda leaf: leaf[-1], saved)

        def nearer(here: Tangents, delay: Scalar) -> Tangents:
            lasts = jnp.where(delay <= 2.0 * early, (1.0 - _LEFT) * jnp.maximum(delay, 0.0), 0.0)
            return tangents_after(how, here, seeded, lasts, engine)

        moves = _at_events(system, scene, at, end, found.ending, section, rtol, seeded, nearer)
        time = jnp.where(by_clock[:, None], 0.0, moves.time)
        columns = jnp.where(by_clock[:, None, None], columns, moves.state)
    fields = jax.vmap(lambda y: system.vector_field(0.0, y, scene))(at.state)
    rates = jnp.stack(jtu.tree_leaves(fields), 1)
    reached = jnp.isfinite(t)[:, None]
    return Slopes(
        time=jnp.where(reached, time, 0.0),
        state=jnp.where(reached[..., None], columns, 0.0),
        clock=by_clock.astype(t.dtype),
        rates=jnp.where(reached, rates, 0.0),
    )


def _at_events(
    system: AbstractSystem,
    scene: AbstractScene,
    at: TangentsAtTimes,
    end: PyTree,
    ending: Scalar,
    section: AbstractSection | None,
    rtol: Scalar,
    seeded: Seeded,
    nearer: Callable[[Tangents, Scalar], Tangents],
) -> EventMotion:
    """At arrivals at a section, but at last where the simulation ends.

    `nearer` follows the motion from before an event almost as far as that.
    """
    unit = units_of(scene, end).time

    def follow(surface: Callable[[PyTree, PyTree], Scalar], here: TangentsAtTimes) -> EventMotion:
        def event(at: Tangents) -> EventMotion:
            return follow_event(
                surface,
                lambda a, y: system.vector_field(0.0, y, a),
                at,
                seeded,
                rtol=rtol,
                unit=unit,
            )

        first = Tangents(here.state, here.columns.T)
        return event(nearer(first, event(first).delay))

    def arrive(here: TangentsAtTimes) -> EventMotion:
        assert section is not None

        def surface(a: PyTree, y: PyTree) -> Scalar:
            near, y = (system.section_state(a, each) for each in (here.state, y))
            return section.value(a, system.in_nearest_names(section, a, near, y))

        moves = follow(surface, here)
        if not section.behind_reset:
            return moves
        reset = system.observed_at(section).reset_map
        at_event = Tangents(moves.reached, moves.state.T)
        _, behind = along_columns(lambda y, a: reset(a, y), at_event, seeded)
        return moves._replace(state=as_columns(behind).T)

    last = jtu.tree_map(lambda leaf: leaf[-1], at)
    moments = [
        jtu.tree_map(
            lambda leaf: leaf[None],
            follow(lambda a, y: system.ending_surface(ending, a, end, y), last),
        )
    ]
    if section is not None:
        moments.insert(0, jax.vmap(arrive)(jtu.tree_map(lambda leaf: leaf[:-1], at)))
    found: EventMotion = jtu.tree_map(lambda *each: jnp.concatenate(each), *moments)
    return found


class _Strike(NamedTuple):
    """A heel strike's time and the state after it, with their derivatives."""

    t: Scalar
    time: Scalar
    after: Tangents


@host_jit()
def rigid_slopes_of(
    walk: Landing,
    strikes: Scalar,
    count: Scalar,
    end: Scalar,
    ending: Scalar,
    moments: Scalar | None = None,
    *,
    section: AbstractSection | None = None,
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> Slopes:
    """Derivatives with respect to some leaves of the state and of the scene.

    They are those behind all heel strikes and at the end; at `moments`, those of times where there
    is no section, else of arrivals there and at the end.

    Args:
        walk: what walked, from where, for how long and how exactly.
        strikes: times of heel strikes [s], of which the first `count` came; NaN is told where
            there were more.
        count: how many there were.
        end, ending: when and how the walk ended.
        moments: times [s] at which was saved, infinite where that did not come; None: strikes were.
        section: at which these are arrivals.
        places, active: of the leaves that are differentiated.
    """
    scene, state = in_64_bits((walk.scene, walk.state))
    start, seeded = seeded_directions(scene, state, places, active)
    watch = Watch.of(ROLLING, resets=hasattr(state, "mode"))
    how = motion_solve(watch, Rodas5P(), walk.rtol)
    unit = jnp.sqrt(scene.mechanism.height / scene.ground.g)
    n = len(places) + len(active)

    def follow(since: _Strike, t: Scalar) -> Tangents:
        """With derivatives at this very time."""
        found = tangents_after(how, since.after, seeded, t - since.t)
        velocity = as_columns(rolling_field(0.0, found.state, scene))
        return found._replace(columns=found.columns - velocity[:, None] * since.time)

    def event(surface: PyTree, at: Tangents) -> EventMotion:
        return follow_event(
            surface, lambda a, y: rolling_field(0.0, y, a), at, seeded, rtol=walk.rtol, unit=unit
        )

    def strike(before: _Strike, given: tuple[Scalar, Scalar]) -> tuple[_Strike, _Strike]:
        t, comes = given
        at = follow(before, jnp.where(comes, t, before.t))
        moves = event(lambda a, y: -opening(a, y), at)
        # This solve's own strike, lest its phase drift away from the walk's.
        rates = rolling_field(0.0, at.state, scene)
        on = jtu.tree_map(lambda leaf, rate: leaf + rate * moves.delay, at.state, rates)
        after, columns = along_columns(
            lambda y, a: impact(a, y).state, Tangents(on, moves.state.T), seeded
        )
        found = _Strike(t + moves.delay, moves.time, Tangents(after, as_columns(columns)))
        found = select(comes, found, before)
        return found, found

    first = _Strike(jnp.zeros_like(end), jnp.zeros(n), start)
    reached = jnp.arange(len(strikes)) < count
    last, each = jax.lax.scan(strike, first, (strikes, reached))

    def at_moment(t: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        before = jnp.sum(reached & (strikes <= t))
        since = jtu.tree_map(lambda a, rest: jnp.append(a[None], rest, 0)[before], first, each)
        here = follow(since, jnp.where(jnp.isfinite(t), t, since.t))
        rates = as_columns(rolling_field(0.0, here.state, scene))
        if section is None:
            return jnp.zeros(n), here.columns.T, rates
        moves = event(section.value, here)
        return moves.time, moves.state, rates

    saved = None
    if moments is not None:
        known, k, c = jnp.isfinite(moments), len(moments), len(state)
        time, columns, rates = jnp.zeros((k, n)), jnp.zeros((k, n, c)), jnp.zeros((k, c))
        if n:
            time, columns, rates = jax.lax.map(at_moment, moments)
        saved = Slopes(
            jnp.where(known[:, None], time, 0.0),
            jnp.where(known[:, None, None], columns, 0.0),
            jnp.zeros_like(moments),  # times to save at are known: they do not move
            rates,
        )
        if section is None:
            return saved
    at = follow(last, end)

    def fallen(a: RigidScene, y: Any) -> Scalar:
        side = jnp.where(ending == int(Ending.FELL_FORWARD), -1.0, 1.0)
        return -uprightness(a, y, side)

    moves = event(fallen, at)
    struck = (count > 0) & (end <= strikes[jnp.maximum(count - 1, 0)])
    by_clock = ~struck & (end >= walk.duration)
    lost = jnp.where(count > len(strikes), jnp.nan, 0.0)
    time = jnp.where(struck, last.time, jnp.where(by_clock, 0.0, moves.time)) + lost
    columns = jnp.where(by_clock, at.columns.T, moves.state)
    columns = jnp.where(struck, last.after.columns.T, columns) + lost
    rates = as_columns(rolling_field(0.0, at.state, scene))
    if saved is None:
        behind = jnp.swapaxes(each.after.columns, 1, 2)
        saved = Slopes(
            jnp.where(reached[:, None], each.time, 0.0),
            jnp.where(reached[:, None, None], behind, 0.0),
            jnp.zeros(len(strikes)),
            jnp.broadcast_to(rates, (len(strikes), len(rates))),
        )
    last_one = Slopes(time, columns, jnp.where(by_clock, 1.0, 0.0), rates)
    found: Slopes = jtu.tree_map(lambda rows, row: jnp.append(rows, row[None], 0), saved, last_one)
    return found


def with_derivatives(
    run: _Run,
    compute: Callable[[_Run], Trajectory[Any]],
    *,
    moving: Callable[[_Run], tuple[PyTree, PyTree, PyTree]],
    slopes: Callable[[_Run, Trajectory[Any], tuple[int, ...], tuple[int, ...]], Slopes],
) -> Trajectory[Any]:
    """`compute(run)`, with derivatives of the times and states that are saved.

    Args:
        run: what is simulated.
        compute: simulates it.
        moving: what of it may be differentiated: the start, the scene, and the times at which a
            clock ends or saves it.
        slopes: derivatives of what was found with respect to some leaves of start and scene.

    Raises:
        ArgumentError: what is asked has no derivatives; before anything is simulated.
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
            check_derivatives(once)
            found = compute(whole(primals)) if known else function(*primals)
            at = slopes(once, found, tuple(state_dots), tuple(scene_dots))
        along = [*state_dots.values(), *scene_dots.values()]
        return found, _tangent_of(found, *_contract(at, along, *clock_dots.values()))

    function.defjvp(rule, symbolic_zeros=True)
    return function(*(leaves[i] for i in traced))


def check_derivatives(run: Any) -> None:
    """Raises `ArgumentError` for a request whose results have no derivatives."""
    refused = {
        'save = "steps"': (run.save_steps, 'ask for save="end", an array of times or a section'),
        "extremes": (run.extremes is not None, "only times and states have derivatives"),
        "integrals": (run.integrals is not None, "only times and states have derivatives"),
    }
    for argument, (is_so, instead) in refused.items():
        if is_so:
            raise ArgumentError(f"{argument} is not allowed under derivatives: {instead}.")


def first_derivatives_only(leaves: PyTree, function: str) -> PyTree:
    """The same numbers without derivatives: what has first ones of them refuses second ones.

    `function` is the name of what has them, for the refusal.
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

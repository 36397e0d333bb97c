"""Walks of the rigid walker, also to a wanted accuracy."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_count,
    check_positive,
    check_room,
    check_unbatched,
    traced_rules,
)
from jaxbiped._debug_switches import without_switches
from jaxbiped._types import Parameter, as_float, by_numpy
from jaxbiped.compiler import Request
from jaxbiped.dynamics._state import RigidState, check_state
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._scene_checks import check_scene, where_allowed
from jaxbiped.simulate._derivatives import with_derivatives
from jaxbiped.simulate._error_witnesses import Witness, check_accurate_walk, judge_walk
from jaxbiped.simulate._slopes import Slopes, rigid_slopes_of
from jaxbiped.simulate._start import check_single_scene, in_one_precision, in_own_precision
from jaxbiped.solve._accuracy import ACCURACIES
from jaxbiped.solve._engine_names import engine_for, engine_named
from jaxbiped.solve._error_estimate import LOOSER, Judged, check_untraced, refine
from jaxbiped.solve._rigid_program import rigid_program
from jaxbiped.solve._rigid_steps import RigidWalk
from jaxbiped.solve._scene_key import scene_key
from jaxbiped.solve._trajectory import Trajectory, arrivals_among, single_time

_ROOM = 256
"""Heel strikes that there is room for where it is not known how many come."""
_FIRST = 1e-1
"""First tolerance as a share of the relative error wanted."""
_EMBEDDED = 0.3
"""Tolerance of the embedded method's witness over the walk's: its errors are those that the
tolerance bounds, which the walk's are 10 to 30 times below."""
_FINEST = 1e-13
"""Finest relative tolerance: rolling is smooth and never stiff."""
_LOOSEST = 1e-3
"""Loosest tolerance to begin with."""
_PATIENCE = 50.0
"""Time allowed for each footstep, in units of √(l/g)."""


class RigidSimulation(eqx.Module):
    """A prepared rigid walk. Call it for its trajectory.

    Attributes:
        walk: the program's inputs.
        waits: whether the duration only bounds the wait for footsteps.
        embedded: whether steps go on with the embedded solution, one order lower.
        max_arrivals: how many heel strikes to keep.
        engine: "lanes", "cuda" or "xla".
    """

    walk: RigidWalk
    waits: bool = eqx.field(static=True)
    embedded: bool = eqx.field(static=True)
    max_arrivals: int = eqx.field(static=True)
    engine: str = eqx.field(static=True)

    def with_inputs(
        self, *, embedded: bool | None = None, **inputs: Parameter
    ) -> "RigidSimulation":
        """The same with other numbers of `walk`, by name, in its precision."""
        like = self.walk.duration.dtype
        new: Any = {name: as_float(value).astype(like) for name, value in inputs.items()}
        kept = self.embedded if embedded is None else embedded
        return dataclasses.replace(self, walk=self.walk._replace(**new), embedded=kept)

    def __call__(self) -> Trajectory[RigidState]:
        """Solves it, differentiably."""
        walk = with_derivatives(self, RigidSimulation.solved, moving=_moving, slopes=_slopes)
        return dataclasses.replace(walk, scene_key=scene_key(self.walk.scene))

    def solved(self) -> Trajectory[RigidState]:
        """Solves it."""
        state = self.walk.state
        program = rigid_program(self.max_arrivals > 0, self.waits, self.embedded)
        request = Request(program, self.walk, room=self.max_arrivals, quick=True)
        found, recorded, _ = engine_named(self.engine).run(request)
        no_rows = np.zeros((0, 1 + len(state)), state.theta_1.dtype)
        rows = no_rows if recorded is None else recorded.values
        t, end = single_time(found.t, found.state)
        return Trajectory(
            t=t,
            state=end,
            ending=found.ending,
            accepted=found.accepted,
            rejected=found.rejected,
            arrivals=arrivals_among(rows, found.footsteps, state),
            grazes=found.grazes,
            engine=self.engine,
        )


def _moving(run: RigidSimulation) -> tuple[PyTree, PyTree, PyTree]:
    return run.walk.state, run.walk.scene, run.walk.duration


def _slopes(
    run: RigidSimulation,
    found: Trajectory[RigidState],
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> Slopes:
    assert found.arrivals is not None
    count, kept = found.arrivals.total, run.max_arrivals
    strikes = found.arrivals.t
    known = [each for each in (count, run.walk.footsteps) if not isinstance(each, jax.core.Tracer)]
    room = int(known[0]) if known and int(known[0]) else _ROOM
    if room > kept:
        walk: RigidSimulation = jax.lax.stop_gradient(dataclasses.replace(run, max_arrivals=room))
        again = walk.solved().arrivals
        assert again is not None
        strikes = again.t
    slopes = rigid_slopes_of(
        run.walk.scene,
        run.walk.state,
        strikes,
        count,
        found.t[-1],
        found.ending,
        until=run.walk.duration,
        rtol=run.walk.rtol,
        places=places,
        active=active,
    )
    if len(strikes) == kept:
        return slopes
    # Of the strikes only those that are kept, then the end.
    return Slopes(*(jnp.concatenate([leaf[:kept], leaf[-1:]]) for leaf in slopes))


def accurate_rigid_walk(run: RigidSimulation, wanted: float) -> Trajectory[RigidState]:
    """The walk whose estimated relative error is at most `wanted`, or as small as can be had.

    Raises:
        ArgumentError: under `jit`, `vmap` or differentiation.
    """
    check_untraced(wanted, run, ACCURACIES)

    def attempt(tolerance: float) -> tuple[Trajectory[RigidState], Judged]:
        walk = run.with_inputs(rtol=tolerance)()
        looser = run.with_inputs(rtol=LOOSER * tolerance)
        other = run.with_inputs(rtol=_EMBEDDED * tolerance, embedded=True)
        witnesses = tuple(Witness(each(), 1.0) for each in (looser, other))
        bars, relative, obstacle = judge_walk(run.walk.scene, walk, witnesses)
        assert walk.grazes is not None
        # Whether a foot that grazes the ground strikes is for a finer tolerance to tell.
        return walk, (bars, np.inf if int(walk.grazes) else relative, obstacle)

    first = min(_FIRST * wanted, _LOOSEST)
    dtype = run.walk.rtol.dtype
    walk, error = refine(attempt, wanted, first=first, dtype=dtype, finest=_FINEST)
    return dataclasses.replace(walk, error=error)


@without_switches
def rigid_walk(
    scene: RigidScene,
    state: RigidState,
    *,
    footsteps: int | None = None,
    duration: float | None = None,
    accuracy: str | float = "balanced",
    rtol: float | None = None,
    max_arrivals: int = 0,
    max_solver_steps: int = 65536,
    engine: str = "auto",
) -> Trajectory[RigidState]:
    """Walks a rigid walker for a number of footsteps, a time, or whichever ends first.

    Explicit steps of eighth order (Dormand and Prince) under error control. Heel strikes and falls
    are the roots of each step's interpolant, two within one step included, and Newton's method
    lands on them. A foot that comes to the ground, or misses it, by less than the tolerance tells
    does not strike; `grazes` counts these. Works under `jit`, `vmap` and first derivatives, which
    follow the strikes and the end.

    Args:
        scene: the walker.
        state: start, leg 2 standing.
        footsteps: heel strikes after which to end; with a `duration`, too, whichever comes first.
        duration: simulated time [s].
        accuracy: "draft" (1e-4), "balanced" (1e-6) or "tight" (1e-11): the relative tolerance; the
            absolute one (SI) is a hundredth of it. Or a number: the relative error wanted of
            every state and time that is returned, lengths in units of the legs' l, times of
            √(l/g), angles of 1 rad, as in `simulate`; `error` then has the bars, and a
            `RuntimeWarning` tells where they cannot meet the number.
        rtol: relative tolerance, in place of the accuracy's.
        max_arrivals: how many heel strikes to keep.
        max_solver_steps: cap on the attempted steps.
        engine: "xla", "lanes", "cuda" or "auto" (see `ENGINES`).

    Returns:
        When, where and how the walk ended: after a footstep, just after the impact, leg 2
        standing. Its `arrivals` count the heel strikes, and hold the first `max_arrivals`.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.

    Examples:
        >>> import jaxbiped as jb
        >>> scene = jb.ladder()["rigid"]
        >>> start = jb.dynamics.rigid_state(jb.seed_state())
        >>> walk = jb.rigid_walk(scene, start, footsteps=2, engine="lanes")
        >>> str(walk.outcome), int(walk.arrivals.total)
        ('walking', 2)
    """
    with traced_rules() as rules:
        scene = check_scene(scene, RigidScene)
        state = in_one_precision(check_state(in_own_precision(state), RigidState))
        check_single_scene(scene)
        check_unbatched("state", state, "one start")
        if duration is None and footsteps is None:
            raise ArgumentError("duration = None and footsteps = None: say how long to walk.")
        if footsteps is not None:
            check_count("footsteps", footsteps)
        if duration is not None:
            check_unbatched("duration", duration)
            check_positive("duration", duration, "s")
        wanted = check_accurate_walk(accuracy, rtol=rtol)
        named = accuracy if isinstance(accuracy, str) else "balanced"
        tolerance = ACCURACIES[named].rigid_walk if rtol is None else rtol
        check_positive("rtol", tolerance)
    # Of a lane that is not allowed nothing is known from the start.
    state, duration = where_allowed(rules, state), where_allowed(rules, duration, 1.0)
    if max_arrivals:
        check_room("max_arrivals", max_arrivals)
    check_count("max_solver_steps", max_solver_steps)
    narrow = state.theta_1.dtype != jnp.float64
    chosen = engine_for(
        engine,
        obstacle="it computes in 64 bits" if narrow else None,
        by_device=True,
        by_any=True,
    )
    count, longest = 1 if footsteps is None else footsteps, duration
    if duration is None:
        longest = by_numpy(
            lambda numpy, l, g: count * (_PATIENCE * numpy.sqrt(l / g)),
            scene.walker.l,
            scene.ground.g,
        )
    walk = RigidWalk(
        scene=scene,
        state=state,
        duration=as_float(longest),
        footsteps=as_float(0 if footsteps is None else int(footsteps)),
        rtol=as_float(tolerance),
        max_attempts=as_float(max_solver_steps),
    )
    run = RigidSimulation(
        # In the precision of the start, as `simulate` has it.
        jtu.tree_map(lambda leaf: leaf.astype(state.theta_1.dtype), walk),
        waits=duration is None,
        embedded=False,
        max_arrivals=int(max_arrivals),
        engine=chosen,
    )
    return run() if wanted is None else accurate_rigid_walk(run, wanted)

"""Walks of the rigid walker."""

import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._checks import (
    ArgumentError,
    check_count,
    check_positive,
    check_room,
    check_unbatched,
    traced_rules,
)
from jaxbiped._debug_switches import without_switches
from jaxbiped._types import as_float, by_numpy
from jaxbiped.dynamics._state import RigidState, check_state
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._scene_checks import check_scene, where_allowed
from jaxbiped.simulate._accurate_rigid_walk import accurate_rigid_walk
from jaxbiped.simulate._accurate_walk import check_accurate_walk
from jaxbiped.simulate._rigid_simulation import RigidSimulation
from jaxbiped.simulate._start import check_single_scene, in_one_precision, in_own_precision
from jaxbiped.solve._accuracy import ACCURACIES
from jaxbiped.solve._engine_names import engine_for
from jaxbiped.solve._rigid_steps import RigidWalk
from jaxbiped.solve._trajectory import Trajectory

_PATIENCE = 50.0
"""Time allowed for each footstep, in units of √(l/g)."""


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
        engine, obstacle="it computes in 64 bits" if narrow else None, by_device=True
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

"""The return map as a function that JAX can differentiate."""

from collections.abc import Callable
from typing import NamedTuple

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_positive
from jaxbiped._debug_switches import without_switches
from jaxbiped._types import Scalar, Time, as_float, select
from jaxbiped.dynamics._redundant_state import is_redundant, minimal_state, redundant_state
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import check_leaves
from jaxbiped.gait._engine import check_holds_none, orbit_engine
from jaxbiped.gait._gradient_modes import AbstractGradient, Forward, Reverse, check_anywhere
from jaxbiped.gait._return_by_lanes import forward_by_lanes, reverse_by_lanes
from jaxbiped.gait._return_by_xla import forward_by_xla, reverse_by_xla
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.gait._solver import orbit_solver
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene, is_rigid
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.solve._accuracy import ACCURACIES, GAIT_ACCURACIES, precision_of
from jaxbiped.solve._projected_solver import with_projection
from jaxbiped.variational._hybrid_system import (
    AbstractSystem,
    RedundantWalking,
    section_of,
    system_of,
    with_leg_names_of,
)


class Return(NamedTuple):
    """Where the return map leads.

    Attributes:
        state: on the section, after the reset (legs exchanged); cyclic coordinates go on from the
            start's.
        time: duration [s].
        code: 0 for a return, else that of the `Ending` that came instead; state and time are then
            where it ended.
    """

    state: PyTree
    time: Scalar
    code: Scalar


@without_switches
def return_map(
    args: PyTree,
    state: PyTree,
    *,
    section: AbstractSection | None = None,
    footsteps: int = 1,
    gradient: AbstractGradient | None = None,
    accuracy: str = "balanced",
    system: AbstractSystem | None = None,
    solver: str | diffrax.AbstractSolver[PyTree] | None = None,
    max_time: Time = 10.0,
    engine: str = "auto",
) -> Return:
    """Follows a motion to its next arrival at a section, differentiably.

    Derivatives follow the arrival: they are those of the map, not of the motion at a fixed time.

    Args:
        args: the scene, or the parameters of another `system`.
        state: start, on the section or not, either leg standing; for a redundant scene a minimal
            state too, which then comes back as one.
        section: `MidStance()` unless given, `HeelStrike()` for a rigid walker.
        footsteps: how many arrivals to follow.
        gradient: `Forward()` (the default) or `Reverse()`.
        accuracy: "balanced" or "tight".
        system: the walker unless given.
        solver: a name (see `SOLVERS`) or any diffrax solver that estimates its errors; unless
            given "rodas4", for a rigid walker "rodas5p".
        max_time: longest time to an arrival [s].
        engine: "xla", "lanes" or "auto" (see `ENGINES`), which here is "xla" for a system of your
            own. By lanes all directions of a derivative share one solve.

    Returns:
        State at the arrival, time that it took [s], and the code of what ended the motion before
        it, leaves shaped as the start's.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.
        RuntimeError: reverse mode through `Forward()`.
        TypeError: forward mode through `Reverse()`.
    """
    gradient = Forward() if gradient is None else gradient
    check_anywhere(gradient, "a return map")
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    check_count("footsteps", footsteps)
    check_positive("max_time", max_time, "s")
    if system is None:
        args = check_scene(args, Scene, RigidScene, RedundantScene)
        if not hasattr(state, "_fields"):
            raise ArgumentError(f"state = {state!r} is not allowed: give a State.")
        state = check_leaves(state, "state")
    args, state = (jtu.tree_map(as_float, tree) for tree in (args, state))
    redundant = isinstance(args, RedundantScene) and system is None
    enters = redundant and not is_redundant(state)
    if enters:
        state = redundant_state(args, state)
    section = section_of(args, section)
    if system is None:
        state = with_leg_names_of(section, args, state)
    check_holds_none(gradient, system, section)
    method = orbit_solver(solver, rigid=is_rigid(args))
    by = orbit_engine(
        engine,
        solver=method,
        section=section,
        leaves=(args, state),
        system=system,
        redundant=redundant,
    )
    if redundant:
        system, method = RedundantWalking(), with_projection(args, method)
    spec = ReturnMapSpec(
        system=system_of(args) if system is None else system,
        section=section,
        solver=method,
        max_time=max_time,
        steps=1,
        max_solver_steps=ACCURACIES[accuracy].max_solver_steps,
        engine=by,
    )
    follow = _FOLLOW[by, type(gradient)]
    precision = precision_of(accuracy, args)
    time, code = jnp.zeros(()), jnp.asarray(0)
    for _ in range(int(footsteps)):
        arrived, lasted, came = follow(spec, precision, args, state)
        state = select(code == 0, arrived, state)
        time = time + jnp.where(code == 0, lasted, 0.0)
        code = jnp.where(code == 0, came, code)
    return Return(minimal_state(args, state) if enters else state, time, code)


_FOLLOW: dict[tuple[str, type[AbstractGradient]], Callable[..., tuple[PyTree, Scalar, Scalar]]] = {
    ("xla", Forward): forward_by_xla,
    ("xla", Reverse): reverse_by_xla,
    ("lanes", Forward): forward_by_lanes,
    ("lanes", Reverse): reverse_by_lanes,
}

"""The return map as a function that JAX can differentiate, and one return with its derivatives."""

from typing import NamedTuple

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_positive, check_type
from jaxbiped._jax_versions import without_switches
from jaxbiped._types import Scalar, Time, as_float, select
from jaxbiped.dynamics._redundant_state import minimal_state, redundant_state
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import check_leaves, without_whole_turns
from jaxbiped.gait._gradient_modes import AbstractGradient, Forward, Reverse, check_anywhere
from jaxbiped.gait._poincare_map import LinearisedReturn, linearised_return, seed_directions
from jaxbiped.gait._return_derivatives import forward, reverse
from jaxbiped.gait._return_map_spec import arrivals_of, check_holds_none, return_map_spec
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import is_redundant
from jaxbiped.solve._accuracy import ACCURACIES, GAIT_ACCURACIES, Precision, precision_of
from jaxbiped.variational._hybrid_system import AbstractSystem, section_of, with_leg_names_of


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
    footsteps: int | None = None,
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
        footsteps: how many to follow, those of one cycle unless given.
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
    check_positive("max_time", max_time, "s")
    if system is None:
        args = check_scene(args, Scene, RigidScene, RedundantScene)
        if not hasattr(state, "_fields"):
            raise ArgumentError(f"state = {state!r} is not allowed: give a State.")
        state = without_whole_turns(args, check_leaves(state, "state"))
    arrivals = arrivals_of(args, footsteps)
    args, state = (jtu.tree_map(as_float, tree) for tree in (args, state))
    enters = system is None and isinstance(args, RedundantScene) and not is_redundant(state)
    if enters:
        state = redundant_state(args, state)
    section = section_of(args, section)
    if system is None:
        state = with_leg_names_of(section, args, state)
    check_holds_none(gradient, system, section)
    spec = return_map_spec(
        args,
        state,
        section=section,
        solver=solver,
        engine=engine,
        system=system,
        max_time=max_time,
        max_solver_steps=ACCURACIES[accuracy].max_solver_steps,
    )
    follow = reverse if isinstance(gradient, Reverse) else forward
    precision = precision_of(accuracy, args)
    time, code = jnp.zeros(()), jnp.asarray(0)
    for _ in range(arrivals):
        arrived, lasted, came = follow(spec, precision, args, state)
        state = select(code == 0, arrived, state)
        time = time + jnp.where(code == 0, lasted, 0.0)
        code = jnp.where(code == 0, came, code)
    return Return(minimal_state(args, state) if enters else state, time, code)


def linearise_return_map(
    args: PyTree,
    state: PyTree,
    *,
    rtol: float,
    tangent_rtol: float,
    parameters: tuple[str, ...] | None = None,
    section: AbstractSection | None = None,
    footsteps: int | None = None,
    system: AbstractSystem | None = None,
    solver: str | diffrax.AbstractAdaptiveSolver[PyTree] | None = None,
    max_time: Time = 10.0,
    max_solver_steps: int = 32768,
    engine: str = "auto",
) -> LinearisedReturn:
    """Follows a motion for one cycle, with derivatives with respect to its start and parameters.

    It is what `find_gait` evaluates, and its multipliers and sensitivities are read off (see
    `stability_of`, `slopes_of`), for studies of the derivatives themselves. Tolerances are traced:
    any of them are solved by one compiled program.

    Args:
        args: the scene, compliant or rigid, or the parameters of another `system`.
        state: start, on the section or not.
        rtol: relative tolerance of the state; the absolute one (SI, for a walker of the seed's
            size) is a hundredth of it.
        tangent_rtol: relative tolerance of the derivatives; a very large one leaves the choice of
            steps to the state alone.
        parameters: names of the parameters to differentiate with respect to (see
            `parameter_names`), of other `args` those of their leaves; all of them unless given,
            none for ().
        section: `MidStance()` unless given, `HeelStrike()` for a rigid walker.
        footsteps: how many a cycle has, the fewest unless given.
        system: the walker unless given.
        solver: a name (see `SOLVERS`) or any diffrax solver that estimates its errors; unless
            given "rodas4", for a rigid walker "rodas5p".
        max_time: longest time to an arrival [s].
        max_solver_steps: cap on the attempted steps to an arrival.
        engine: "xla", "lanes" or "auto" (see `ENGINES`), which here is "xla" for a system of your
            own.

    Returns:
        The state that returns, period, advance and largest load with their derivatives, those with
        respect to a parameter in units of its size.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.
    """
    if system is None:
        check_type("args", args, Scene, RigidScene)
    for name, tolerance in (("rtol", rtol), ("tangent_rtol", tangent_rtol)):
        check_positive(name, tolerance)
    check_positive("max_time", max_time, "s")
    arrivals = arrivals_of(args, footsteps)
    check_count("max_solver_steps", max_solver_steps)
    _, active = select_parameters(args, parameters)
    args, state = (jtu.tree_map(as_float, tree) for tree in (args, state))
    spec = return_map_spec(
        args,
        state,
        section=section,
        solver=solver,
        engine=engine,
        system=system,
        steps=arrivals,
        max_time=as_float(max_time),
        max_solver_steps=int(max_solver_steps),
    )
    recurring = len(jtu.tree_leaves(state)) - len(spec.system.cyclic_coordinates)
    seeds, _ = seed_directions(args, active, recurring)
    precision = Precision(as_float(rtol), as_float(tangent_rtol))
    return linearised_return(spec, seeds, state, precision, jnp.asarray(False))

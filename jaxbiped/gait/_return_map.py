"""The return map as a function that JAX can differentiate, and one return with its derivatives."""

from typing import NamedTuple

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_positive, check_type
from jaxbiped._jax_versions import without_switches
from jaxbiped._types import Scalar, Time, as_float, in_64_bits, select
from jaxbiped.dynamics._equivalent_states import minimal_state, redundant_state
from jaxbiped.dynamics._state import check_leaves, without_whole_turns
from jaxbiped.dynamics._surfaces import AbstractSection
from jaxbiped.gait._poincare_map import LinearisedReturn, linearised_return, seed_directions
from jaxbiped.gait._return_derivatives import forward, reverse
from jaxbiped.gait._return_map_spec import (
    AbstractGradient,
    Forward,
    Reverse,
    arrivals_of,
    check_gradient,
    check_holds_none,
    return_map_spec,
)
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import is_redundant
from jaxbiped.solve._accuracy import ACCURACIES, GAIT_ACCURACIES, Precision, precision_of
from jaxbiped.variational._hybrid_system import AbstractSystem, section_of, with_leg_names_of


class Return(NamedTuple):
    """An arrival of the return map.

    Attributes:
        state: state on the section after the reset (legs exchanged); cyclic coordinates continue
            from the start.
        time: duration [s].
        code: 0 for a return; otherwise the code of the `Ending` that came instead, and state and
            time are those of that ending.
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

    Derivatives are those of the map, not of the motion at a fixed time.

    Args:
        args: the scene; with `system`, the parameters of that system.
        state: start, on the section or not, with either leg standing. For a redundant scene, it may
            be a minimal state, and the result is then minimal too.
        section: section to arrive at. Default: `MidStance()`; for a rigid walker `HeelStrike()`.
        footsteps: number of footsteps to follow. Default: those of one cycle.
        gradient: `Forward()` (the default) or `Reverse()`.
        accuracy: "balanced" or "tight".
        system: another system, an `AbstractSystem`. Default: the walker.
        solver: a name (see `SOLVERS`) or any diffrax solver that estimates its errors. Default:
            "rodas4"; for a rigid walker "rodas5p".
        max_time: maximum time to an arrival [s].
        engine: "xla", "lanes" or "auto" (see `ENGINES`); for a system of your own, "auto" is "xla".
            With the lanes engine, all directions of a derivative share one solve.

    Returns:
        State at the arrival, duration [s], and a code: 0, or that of the `Ending` that came before
        an arrival. Leaves have the shape of the start's.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.
        RuntimeError: reverse mode is used with `Forward()`.
        TypeError: forward mode is used with `Reverse()`.
    """
    gradient = Forward() if gradient is None else gradient
    check_gradient(gradient)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    check_positive("max_time", max_time, "s")
    if system is None:
        args = check_scene(args, Scene, RigidScene, RedundantScene)
        if not hasattr(state, "_fields"):
            raise ArgumentError(f"state = {state!r} is not allowed: give a State.")
        state = without_whole_turns(args, in_64_bits(check_leaves(state, "state")))
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
    """Follows a motion for one cycle, with its derivatives with respect to start and parameters.

    `find_gait` evaluates this function. Use it to study the derivatives themselves; `stability_of`
    and `slopes_of` compute multipliers and sensitivities from the result. Tolerances are traced, so
    one compiled program serves all of them.

    Args:
        args: the scene, compliant or rigid; with `system`, the parameters of that system.
        state: start, on the section or not.
        rtol: relative tolerance of the state; the absolute one (SI units, for a walker of the
            seed's size) is a hundredth of it.
        tangent_rtol: relative tolerance of the derivatives; if it is very large, the state alone
            determines the steps.
        parameters: names of the parameters to differentiate with respect to (see
            `parameter_names`), or of the leaves of other `args`. Default: all; () for none.
        section: section to arrive at. Default: `MidStance()`; for a rigid walker `HeelStrike()`.
        footsteps: number of footsteps of a cycle. Default: the smallest possible number.
        system: another system, an `AbstractSystem`. Default: the walker.
        solver: a name (see `SOLVERS`) or any diffrax solver that estimates its errors. Default:
            "rodas4"; for a rigid walker "rodas5p".
        max_time: maximum time to an arrival [s].
        max_solver_steps: maximum number of attempted steps to an arrival.
        engine: "xla", "lanes" or "auto" (see `ENGINES`); for a system of your own, "auto" is "xla".

    Returns:
        The returning state, period, advance and largest load, with their derivatives; those with
        respect to a parameter are in units of its size.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.
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

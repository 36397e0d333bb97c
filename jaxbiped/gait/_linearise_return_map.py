"""Linearisation of the return map: one return with its derivatives, at tolerances of one's own."""

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import check_count, check_positive, check_type
from jaxbiped._types import Time, as_float
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.gait._engine import orbit_engine
from jaxbiped.gait._poincare_map import LinearisedReturn, linearised_return, seed_directions
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.gait._solver import orbit_solver
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.scene._scene import RigidScene, Scene, is_rigid
from jaxbiped.solve._accuracy import Precision
from jaxbiped.variational._hybrid_system import AbstractSystem, section_of, system_of


def linearise_return_map(
    args: PyTree,
    state: PyTree,
    *,
    rtol: float,
    tangent_rtol: float,
    parameters: tuple[str, ...] | None = None,
    section: AbstractSection | None = None,
    footsteps: int = 1,
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
        footsteps: how many a cycle has.
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
    check_count("footsteps", footsteps)
    check_count("max_solver_steps", max_solver_steps)
    _, active = select_parameters(args, parameters)
    args, state = (jtu.tree_map(as_float, tree) for tree in (args, state))
    section = section_of(args, section)
    method = orbit_solver(solver, rigid=is_rigid(args))
    spec = ReturnMapSpec(
        system=system_of(args) if system is None else system,
        section=section,
        solver=method,
        max_time=as_float(max_time),
        steps=int(footsteps),
        max_solver_steps=int(max_solver_steps),
        engine=orbit_engine(
            engine, solver=method, section=section, leaves=(args, state), system=system
        ),
    )
    recurring = len(jtu.tree_leaves(state)) - len(spec.system.cyclic_coordinates)
    seeds, _ = seed_directions(args, active, recurring)
    precision = Precision(as_float(rtol), as_float(tangent_rtol))
    return linearised_return(spec, seeds, state, precision, jnp.asarray(False))

"""Specification of a return map: whose it is, how it is solved, and how derivatives are taken."""

import dataclasses

import diffrax
import equinox as eqx
import jax
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_count, check_type
from jaxbiped._types import Scalar, Time
from jaxbiped.caching._cached_jit import note_code
from jaxbiped.caching._known_by_shape import known_by_shape
from jaxbiped.compiler import LANES, XLA, AbstractEngine
from jaxbiped.hybrid._scales import is_stiff
from jaxbiped.hybrid._sections import AbstractSection, section_of
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import (
    AbstractScene,
)
from jaxbiped.scene._state_types import is_redundant
from jaxbiped.solve._engine_names import engine_for, lane_obstacle
from jaxbiped.solve._solvers import solver_named, with_projection
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

_MORE_STEPS = 4
"""Factor of the steps that a return may take where it carries columns of parameters: small
sensitivities are solved as exactly as large ones."""


class AbstractGradient(eqx.Module):
    """A way to take derivatives."""


class Forward(AbstractGradient):
    """Tangents carried along the motion, their errors controlled: for few directions.

    Through XLA every direction is one solve of its own under `jax.jacfwd`, in lockstep; by lanes
    all share one.
    """


class Reverse(AbstractGradient):
    """Reverse mode, for many parameters.

    Through XLA it goes back over the solver's steps, with checkpoints; they are chosen so that the
    derivatives with respect to the whole state keep the derivatives' tolerance, and reverse mode
    is those derivatives' transpose. By lanes the derivatives with respect to every input are
    carried along the motion, as `Forward` does, and transposed.
    """


class Implicit(AbstractGradient):
    """The implicit function theorem at a periodic orbit: every derivative, once, for both modes.

    First derivatives only: a second one is refused.
    """


class ReturnMapSpec(eqx.Module):
    """What does not change from one evaluation of the return map to the next.

    Attributes:
        system, section: whose return map.
        solver: one-step solver.
        steps: arrivals that make one cycle.
        max_time: longest time to the next arrival [s].
        max_solver_steps: cap on the attempted steps to the next arrival.
        engine: "xla" or "lanes".
        within: the system that is solved, where its coordinates are redundant: every solve
            enters them and leaves them again, so that a cycle knows nothing of constraints.
        resets: whether switches reset the state.
    """

    system: AbstractSystem
    section: AbstractSection
    solver: diffrax.AbstractAdaptiveSolver[PyTree]
    max_time: Time
    steps: int = eqx.field(static=True)
    max_solver_steps: int = eqx.field(static=True)
    engine: str = eqx.field(static=True)
    within: AbstractSystem | None = None
    resets: bool = eqx.field(static=True, default=False)

    @property
    def programs(self) -> AbstractEngine | None:
        """The engine whose programs solve it; None where diffrax does, which resets no state."""
        if self.engine == "lanes":
            return LANES
        return XLA if self.resets else None

    def with_more_steps(self) -> "ReturnMapSpec":
        """The same with the steps that a return with columns of parameters may take."""
        return dataclasses.replace(self, max_solver_steps=_MORE_STEPS * self.max_solver_steps)

    def watch(
        self,
        args: PyTree,
        y: PyTree,
        *,
        peak: bool = True,
        of: AbstractSystem | None = None,
    ) -> Watch:
        """What the solves end on: a section is looked at after the arrival's reset."""
        system = self.system if of is None else of
        loaded = system.load_exists(args, y)
        return Watch.of(
            system,
            resets=has_switches(system, args, y, "resets"),
            section=_Arrival(system, self.section),
            asked_before=self.section.behind_reset,
            ending=system.ending,
            peak=system.load if peak and loaded else None,
            project=system.project if system.projects(args) else None,
        )


@known_by_shape
def has_switches(system: AbstractSystem, args: PyTree, y: PyTree, kind: str = "value") -> bool:
    """Whether a system has switches, all or those of a kind (`resets`, `first_only`)."""
    switches = system.switches(args, y)
    return any(kind == "value" or getattr(switch, kind) for switch in switches)


def runs_by_lanes(spec: ReturnMapSpec, *_: object, **__: object) -> bool:
    """Whether a function of a return map leaves the work to programs of lanes."""
    return spec.engine == "lanes"


def return_map_spec(
    args: PyTree,
    state: PyTree,
    *,
    solver: str | diffrax.AbstractSolver[PyTree] | None,
    engine: str,
    max_solver_steps: int,
    section: AbstractSection | None = None,
    system: AbstractSystem | None = None,
    steps: int = 1,
    max_time: Time | None = None,
) -> ReturnMapSpec:
    """Checks how a return map is to be solved, and forms it.

    Args:
        args: the scene, or the parameters of another `system`.
        state: state on its orbits; minimal for a redundant scene, unless its returns are to be in
            the coordinates of each leg.
        section: section of the returns. Default: the scene's own.
        solver: name of the solver, the solver itself, or None for the usual one.
        engine: one of `ENGINES`.
        system: a user's own system, if any; it is not known whether lanes can express it.
        steps, max_time, max_solver_steps: as in the spec. Default of `max_time`: a walker's.

    Raises:
        ArgumentError: a section, solver or engine that is unknown or cannot do this.
    """
    note_code(args, section, solver, system)
    if system is not None:
        check_type("system", system, AbstractSystem)
    own, within = _systems_of(args, state) if system is None else (system, None)
    own.check_cycles(args)
    section = section_of(args, section)
    method = orbit_solver(solver, stiff=is_stiff(args))
    obstacle = lane_obstacle(method, section, (args, state), columns=True)
    own = own.observed_at(section)
    if holds_arrays(system):
        obstacle = f"the system {type(system).__name__} holds arrays, which belong in args"
    by = engine_for(engine, obstacle=obstacle, prefers_xla=system is not None)
    resets = has_switches(own, args, state, "resets")
    if by == "xla" and resets and not own.lands:  # which would compile for minutes
        raise ArgumentError(
            f"engine = {engine!r} is not allowed for a walker whose modes change: its gaits are "
            'found by lanes; give engine="lanes" and one of its solvers (rodas3p to rodas5p).'
        )
    if resets and not isinstance(method, AbstractRosenbrock):
        raise ArgumentError(
            f"solver = {type(method).__name__} is not allowed where the state is reset within a "
            "cycle: give one of rodas3p to rodas5p."
        )
    if by == "xla":
        method = with_projection(own if within is None else within, args, method)
    return ReturnMapSpec(
        system=own,
        section=section,
        solver=method,
        max_time=own.longest_wait(args) if max_time is None else max_time,
        steps=steps,
        max_solver_steps=max_solver_steps,
        engine=by,
        within=within,
        resets=resets,
    )


def _systems_of(
    scene: AbstractScene, state: PyTree
) -> tuple[AbstractSystem, AbstractSystem | None]:
    """The system with the coordinates of a state, and the one that is solved if it is another."""
    solved = system_of(scene)
    if scene.minimal is scene or is_redundant(state):
        return solved, None
    return system_of(scene.minimal), solved


def arrivals_of(args: PyTree, footsteps: int | None) -> int:
    """Number of arrivals at the section in this many footsteps. Default: those of one cycle.

    Raises:
        ArgumentError: the number is not one of whole cycles.
    """
    own = each = 1
    if isinstance(args, AbstractScene):
        own, each = args.cycle_footsteps, args.arrival_footsteps
    if footsteps is None:
        return own // each
    check_count("footsteps", footsteps)
    if int(footsteps) % own:
        raise ArgumentError(
            f"footsteps = {footsteps} is not allowed: a cycle of this walker has {own} footsteps, "
            f"so give a multiple of {own}."
        )
    return int(footsteps) // each


def orbit_solver(
    solver: str | diffrax.AbstractSolver[PyTree] | None, *, stiff: bool
) -> diffrax.AbstractAdaptiveSolver[PyTree]:
    """The solver of that name, the one given, or the usual one: "rodas4" where motion may be stiff.

    Raises:
        ArgumentError: an unknown name, or a solver that does not estimate its errors.
    """
    usual = "rodas4" if stiff else "rodas5p"
    found = solver_named(usual if solver is None else solver)
    if not isinstance(found, diffrax.AbstractAdaptiveSolver):
        raise ArgumentError(
            f"solver = {type(found).__name__} is not allowed: it does not estimate its errors, by "
            "which steps are chosen."
        )
    return found


def check_gradient(gradient: AbstractGradient) -> None:
    """Raises `ArgumentError` for a mode that needs a periodic orbit."""
    if not isinstance(gradient, AbstractGradient):
        raise ArgumentError(
            f"gradient = {gradient!r} is not allowed: it must be Forward() or Reverse()."
        )
    if isinstance(gradient, Implicit):
        raise ArgumentError(
            "gradient = Implicit() is not allowed for a return map, which need not be periodic: "
            "choose Forward() or Reverse()."
        )


def check_holds_none(
    gradient: AbstractGradient, system: AbstractSystem | None, section: AbstractSection
) -> None:
    """Raises `ArgumentError` for reverse mode where a system or section holds arrays."""
    holder = next((each for each in (system, section) if holds_arrays(each)), None)
    if isinstance(gradient, Reverse) and holder is not None:
        raise ArgumentError(
            f"gradient = Reverse() is not allowed here: {type(holder).__name__} holds arrays, "
            "which belong in args."
        )


def holds_arrays(tree: PyTree) -> bool:
    """Whether there are arrays, known or traced, among the leaves."""
    return any(isinstance(leaf, jax.Array | np.ndarray) for leaf in jtu.tree_leaves(tree))


class _Arrival(eqx.Module):
    """The section's value and whether a crossing counts."""

    system: AbstractSystem
    section: AbstractSection

    def __call__(self, args: PyTree, y: PyTree) -> tuple[Scalar, Scalar]:
        return self.system.arrival(self.section, args, y)

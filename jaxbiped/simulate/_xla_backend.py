"""Simulation by diffrax, compiled by XLA."""

from typing import TYPE_CHECKING, Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import Array, PyTree

from jaxbiped._ending import Ending
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import field_of
from jaxbiped.scene._scene import RedundantScene
from jaxbiped.solve._failure_events import ending_code, ending_events
from jaxbiped.solve._solvers import with_projection, with_root_tolerances
from jaxbiped.solve._trajectory import Trajectory
from jaxbiped.solve.controllers._event_steps import (
    PATIENCE,
    FootstepLimit,
    LocatedEnding,
    MissedContacts,
)
from jaxbiped.solve.controllers._step_size import walk_control
from jaxbiped.solve.controllers._wrapped_control import (
    Extremes,
    GivenFirstStep,
    first_step,
)

if TYPE_CHECKING:
    from jaxbiped.simulate._simulation import Simulation


@cached_jit
def by_xla(run: "Simulation") -> Trajectory:
    """Runs a request; see `simulate`. A trajectory saved step by step keeps its full length."""
    solver: diffrax.AbstractSolver[PyTree] = run.solver
    adjoint = diffrax.RecursiveCheckpointAdjoint() if run.adjoint is None else run.adjoint
    weight: float = getattr(solver, "switch_weight", 1.0)
    controller: PyTree = walk_control(run.rtol, run.atol, run.units, switch_weight=weight)
    if run.dt is not None:
        constant: PyTree = diffrax.ConstantStepSize()
        controller = MissedContacts(constant)
        solver = with_root_tolerances(solver, run.rtol, run.atol)
    if run.footsteps is not None:
        controller = FootstepLimit(controller, run.footsteps)
    if run.dt is None:
        controller = LocatedEnding(controller, run.watch)
    if run.extremes is not None:
        controller = Extremes(controller, run.extremes)
    size = first_step(run.duration, run.units.time) if run.dt is None else run.dt
    events = ending_events(run.watch)
    zero = jnp.zeros_like(run.duration)
    if isinstance(run.scene, RedundantScene):
        solver = with_projection(run.scene, solver, adjoint)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field_of(run.scene)),
        solver,
        t0=zero,
        t1=run.duration,
        dt0=None,
        y0=run.state,
        args=run.scene,
        saveat=_saveat(run),
        stepsize_controller=GivenFirstStep(controller, size),
        event=diffrax.Event(list(events.values())) if events else None,
        max_steps=run.max_solver_steps,
        adjoint=adjoint,
        throw=False,
    )
    control, lowest, highest = solution.controller_state, None, None
    if run.extremes is not None:
        watched: PyTree = control
        control, lowest, highest = watched
    missed = None
    if run.dt is not None:
        counted: PyTree = control if run.footsteps is None else control[0]
        _, missed = counted
    return Trajectory(
        t=solution.ts,
        state=solution.ys,
        ending=_ending(solution, control, list(events), run),
        accepted=solution.stats["num_accepted_steps"],
        rejected=solution.stats["num_rejected_steps"],
        dense=solution.interpolation if run.save_steps else None,
        lowest=lowest,
        highest=highest,
        correction=run.correction,
        missed_contacts=missed,
    )


def _saveat(run: "Simulation") -> diffrax.SaveAt:
    keeps = any(each is not None for each in (run.footsteps, run.extremes, run.dt))
    if run.save_steps:
        return diffrax.SaveAt(t0=True, steps=True, dense=True, controller_state=keeps)
    if run.times is not None:
        return diffrax.SaveAt(ts=run.times, controller_state=keeps)
    return diffrax.SaveAt(t1=True, controller_state=keeps)


def _ending(
    solution: diffrax.Solution, control: PyTree, names: list[Ending], run: "Simulation"
) -> Array:
    results = diffrax.RESULTS
    out_of_steps: Any = solution.result == results.max_steps_reached
    done: Any = solution.result == results.successful
    timed_out = jnp.zeros_like(done)
    if run.footsteps is not None:
        _, _, count = control
        # Time ran out before the footsteps came, where only footsteps were asked for.
        timed_out = done & (count < run.footsteps) & (run.duration >= PATIENCE * run.footsteps)
        done = (done & ~timed_out) | (solution.result == results.event_occurred)
    masks: PyTree = solution.event_mask
    events = dict(zip(names, masks or [], strict=True))
    return ending_code(events, done=done, out_of_steps=out_of_steps, timed_out=timed_out)


def trim(trajectory: Trajectory) -> Trajectory:
    """Cuts unused room off a single trajectory; one that is being traced keeps it."""
    if trajectory.dense is None or isinstance(trajectory.t, jax.core.Tracer):
        return trajectory
    length = int(trajectory.accepted) + 1
    return eqx.tree_at(
        lambda each: (each.t, each.state),
        trajectory,
        (trajectory.t[:length], jtu.tree_map(lambda leaf: leaf[:length], trajectory.state)),
    )

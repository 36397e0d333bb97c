"""Backends of simulations: diffrax, compiled by XLA, and lanes; and which of them is asked."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped._types import as_float, is_traced
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import BY_NAME, LaneEngine, Request
from jaxbiped.hybrid._endings import ending_code
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.simulate._start import Options
from jaxbiped.simulate._trajectory import Trajectory, arrivals_among, single_time
from jaxbiped.solve._adaptive_program import AdaptiveSolve, Solve
from jaxbiped.solve._engine_names import engine_for, lane_obstacle
from jaxbiped.solve._recorders import (
    AbstractRecorder,
    ArrivalRecorder,
    StepRecorder,
    TimeRecorder,
    program_of,
)
from jaxbiped.solve._runge_kutta import stepper_of
from jaxbiped.solve._solved import Solved
from jaxbiped.solve._solvers import with_projection, with_root_tolerances
from jaxbiped.solve._step_records import recorded_steps
from jaxbiped.solve._stepper import Stepper
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
    StepsOfOneSize,
    first_step,
    just_before_end,
)

if TYPE_CHECKING:
    from jaxbiped.simulate._abstract_simulation import AbstractSimulation
    from jaxbiped.simulate._simulation import Simulation

_QUICK = 100_000
"""Attempted steps that take less than a second."""
_ROOM = 1 << 18
"""Steps that there is room for at first; who takes more runs again, with room for as many."""


def choose_engine(asked: Options, solver: diffrax.AbstractSolver[PyTree], leaves: PyTree) -> str:
    """The engine that "auto" stands for, or the one that is asked for.

    Raises:
        ArgumentError: an unknown name, or lanes or CUDA for what they cannot do.
    """
    obstacle = _hindrance(asked, solver, leaves)
    section = asked.section
    if section is None:
        return engine_for(asked.engine, obstacle=obstacle, by_device=True)
    # The programs of lanes alone record arrivals; XLA runs these, too.
    if obstacle is not None:
        raise ArgumentError(f"save = {type(section).__name__}() is not allowed here: {obstacle}.")
    return engine_for(asked.engine, obstacle=None, by_device=True)


def _hindrance(
    asked: Options, solver: diffrax.AbstractSolver[PyTree], leaves: PyTree
) -> str | None:
    """Why lanes cannot do what is asked."""
    if asked.save_steps and is_traced(jtu.tree_leaves(leaves)):
        return (
            'under jit, vmap or derivatives it does not save every step (save="steps"); ask for '
            'save="end", an array of times or a section'
        )
    if asked.adjoint is not None:
        return "an adjoint is diffrax's"
    if isinstance(asked.times, jax.core.Tracer):
        return "the times to save at must be known beforehand"
    return lane_obstacle(solver, asked.section, leaves)


@cached_jit
def by_xla(run: "Simulation") -> Trajectory:
    """Runs a request; see `simulate`. A trajectory saved step by step keeps its full length."""
    solver: diffrax.AbstractSolver[PyTree] = run.solver
    system = system_of(run.scene)
    adjoint = diffrax.RecursiveCheckpointAdjoint() if run.adjoint is None else run.adjoint
    weight: float = getattr(solver, "switch_weight", 1.0)
    controller: PyTree = walk_control(run.rtol, run.atol, run.units, system, switch_weight=weight)
    if run.dt is not None:
        constant: PyTree = diffrax.ConstantStepSize()
        controller = MissedContacts(constant, system)
        solver = with_root_tolerances(solver, run.rtol, run.atol)
    if run.footsteps is not None:
        controller = FootstepLimit(controller, run.footsteps, system)
    if run.dt is None:
        controller = LocatedEnding(controller, system, run.watch)
    if run.extremes is not None:
        controller = Extremes(controller, run.extremes)
    size = first_step(run.duration, run.units.time) if run.dt is None else run.dt
    events = system.failures(run.watch)
    solver = with_projection(system, run.scene, solver, adjoint)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(system.vector_field),
        solver,
        t0=jnp.zeros_like(run.duration),
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
    control: Any = solution.controller_state
    lowest = highest = missed = None
    if run.extremes is not None:
        control, lowest, highest = control
    if run.dt is not None:
        _, missed = control if run.footsteps is None else control[0]
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
    return diffrax.SaveAt(t1=run.times is None, ts=run.times, controller_state=keeps)


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
    return ending_code(
        dict(zip(names, solution.event_mask or [], strict=True)),
        done=done,
        out_of_steps=out_of_steps,
        timed_out=timed_out,
        reached=system_of(run.scene).reached,
    )


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


def by_lanes(run: "Simulation", request: Request | None = None) -> Trajectory:
    """Runs a request; see `simulate`. What it asks of lanes may be known, see `lane_request`."""
    request = lane_request(run) if request is None else request
    dense, arrivals = None, None
    if run.save_steps:
        ended, rows = _step_by_step(run, request)
        resets = system_of(run.scene).resets
        t, state, dense = recorded_steps(run.state, rows, _stepper(run), resets=resets)
    else:
        times = None if run.times is None else np.asarray(run.times)
        room = 0 if run.section is None else run.max_arrivals
        asked = request._replace(times=times, room=room)
        ended, recorded, _ = BY_NAME[run.engine].run(asked)
        t, state = single_time(ended.t, ended.state)
        if recorded is not None:
            # As diffrax has it: infinite where the solve ended before.
            saved = arrivals_among(recorded.values, jnp.asarray(recorded.counts), run.state)
            if run.section is None:
                t, state = saved.t, saved.state
            else:
                arrivals = saved
    return Trajectory(
        t=t,
        state=state,
        dense=dense,
        arrivals=arrivals,
        correction=run.correction,
        engine=run.engine,
        endings=run.scene.endings,
        **ended.outcome,
    )


def lane_request(run: "Simulation") -> Request:
    """What a request asks of lanes, which may hold no operation that it needs."""
    footsteps = 0 if run.footsteps is None else run.footsteps
    solve = Solve(
        scene=run.scene,
        state=run.state,
        duration=run.duration,
        almost=just_before_end(run.duration),
        rtol=run.rtol,
        atol=run.atol,
        units=run.units,
        footsteps=as_float(footsteps),
        patience=as_float(PATIENCE * footsteps),
        max_attempts=as_float(run.max_solver_steps),
        steps=None if run.dt is None else StepsOfOneSize.of(run.dt, run.duration),
    )
    steps = AdaptiveSolve(
        system=system_of(run.scene),
        stepper=_stepper(run),
        watch=run.watch,
        counting=run.footsteps is not None,
        recorder=recorder_for(run),
        extremes=run.extremes,
        integrals=run.integrals,
        located=run.dt is None,
        fenced=run.engine == "xla",
    )
    return Request(program_of(steps), solve, quick=run.max_solver_steps <= _QUICK)


def _stepper(run: "Simulation") -> Stepper:
    """That of its solver, which lanes were asked about before."""
    stepper = stepper_of(run.solver)
    assert stepper is not None
    return stepper


def recorder_for(run: "AbstractSimulation") -> AbstractRecorder | None:
    """What saves as a request asks; None: the end alone is saved."""
    if run.section is not None:
        return ArrivalRecorder(run.section)
    if run.save_steps:
        return StepRecorder()
    return None if run.times is None else TimeRecorder()


def prepare_lanes(run: "Simulation", request: Request) -> Callable[["Simulation"], Trajectory]:
    """`by_lanes`, with all compiled that it needs for one simulation.

    Where only the end is asked for, what JAX does around it is compiled as well.
    """
    engine = BY_NAME[run.engine]
    if isinstance(engine, LaneEngine):
        engine.compile(request).prepare(1)
    within = run.save_steps or run.times is not None or run.section is not None
    return by_lanes if within else _compiled


_compiled = cached_jit(by_lanes)


def _step_by_step(run: "Simulation", request: Request) -> tuple[Solved, np.ndarray]:
    """One simulation, not traced, and the records of its steps, (n, numbers)."""
    engine, room = BY_NAME[run.engine], min(run.max_solver_steps, _ROOM)
    if lanes := isinstance(engine, LaneEngine):
        one = jtu.tree_map(lambda leaf: np.asarray(leaf)[None], request.inputs)
        request = request._replace(inputs=one, batch=True)
    while True:
        found = engine.run(request._replace(room=room))
        outputs, recorded = found.outputs, found.records
        assert recorded is not None
        if lanes:
            outputs, recorded = jtu.tree_map(lambda leaf: leaf[0], (outputs, recorded))
        steps = int(recorded.counts)
        if steps <= room:
            return jax.device_put(outputs), np.array(recorded.values[:steps])
        # Memory is asked for by what a solve takes, not by what it might.
        room = steps

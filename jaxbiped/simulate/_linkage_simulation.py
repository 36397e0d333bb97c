"""Motion of a linkage in gravity."""

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_count,
    check_finite,
    check_increasing,
    check_not_negative,
    check_positive,
    check_type,
    warn,
)
from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, as_float, is_traced
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import LANES, Request
from jaxbiped.constraints._constraint_methods import check_independent, nearest_consistent
from jaxbiped.constraints._linkage import Constraints, constraints_of
from jaxbiped.dynamics._constrained_motion import LinkageState
from jaxbiped.hybrid._linkage_system import Swinging
from jaxbiped.hybrid._scales import Units
from jaxbiped.scene._linkages import LinkageScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.simulate._start import Options, check_steps
from jaxbiped.solve._accuracy import rms_norm, tolerances
from jaxbiped.solve._adaptive_program import AdaptiveSolve, Solve, adaptive_program
from jaxbiped.solve._engine_names import engine_for, lane_obstacle
from jaxbiped.solve._recorders import TimeRecorder
from jaxbiped.solve._runge_kutta import stepper_of
from jaxbiped.solve._solvers import (
    check_adjoint,
    solver_named,
    with_projection,
    with_root_tolerances,
)
from jaxbiped.solve._trajectory import Trajectory, arrivals_among
from jaxbiped.solve.controllers._step_size import step_control
from jaxbiped.solve.controllers._wrapped_control import (
    StepControl,
    StepsOfOneSize,
    first_step,
    just_before_end,
)

_FAR = 0.5
"""Distance of a start from its joints, in units of the longest arm, beyond which it is refused."""
_LONGER, _LONG = 2.0, 1e-2
"""Factor to the steps that steps of one size are held against, and the relative change of the final
state from which they are too long."""


def simulate_linkage(
    scene: LinkageScene, state: LinkageState, asked: Options
) -> Trajectory[LinkageState]:
    """Checks what is asked, and simulates a linkage from a start put on its constraints."""
    walks = ("duration", "footsteps", "max_arrivals", "extremes", "watch", "engine")
    asked.refuse(scene, *walks)
    times, dt, adjoint = asked.times, asked.dt, asked.adjoint
    if times is None:
        raise ArgumentError(
            f"save = {asked.save!r} is not allowed for a LinkageScene: give increasing times."
        )
    scene = check_scene(scene, LinkageScene)
    check_type("state", state, LinkageState)
    count = scene.linkage.coordinates * len(scene.linkage.bodies)
    for name in ("q", "v"):
        values = getattr(state, name)
        if len(values) != count:
            raise ArgumentError(
                f"state.{name} has {len(values)} entries: this linkage has {count} coordinates."
            )
        for value in values:
            check_finite(f"state.{name}", value)
    state = LinkageState(*(tuple(map(as_float, values)) for values in state))
    check_finite("times", times)
    check_increasing("times", times, 1)
    check_not_negative("times", times, "s")
    check_count("max_solver_steps", asked.max_solver_steps)
    times = as_float(times)
    check_positive("times[-1]", times[-1], "s")
    method = solver_named(asked.solver)
    check_steps(method, dt, most_steps=asked.max_solver_steps, duration=times[-1])
    check_independent(scene.linkage, scene.method, state.q)
    _check_joints(scene, state)
    check_adjoint(scene.method, adjoint)
    relative, absolute = map(as_float, tolerances(asked.accuracy, asked.rtol, asked.atol))
    step = None if dt is None else as_float(dt)
    problem = scene, state, times
    if adjoint is None and not is_traced((*problem, step, relative, absolute)):
        request = _lane_request(problem, method, (relative, absolute), step, asked)
        if request is not None:
            swung = _by_lanes(problem, request)
            if step is not None:
                request = _with_steps(request, _LONGER * step)
                _warn_of_long_steps(swung, float(step), _by_lanes(problem, request))
            return swung
    control = step_control(relative, absolute, rms_norm) if dt is None else None
    chosen = diffrax.RecursiveCheckpointAdjoint() if adjoint is None else adjoint
    if dt is not None:
        method = with_root_tolerances(method, relative, absolute)
    how = method, control
    try:
        swung = _solve(*problem, *how, step, asked.max_solver_steps, chosen)
    except TypeError as error:
        if adjoint is not None or "forward-mode" not in str(error):
            raise
        raise ArgumentError(
            "adjoint = None is not allowed in forward mode: choose diffrax.ForwardMode()."
        ) from error
    if step is not None and not is_traced((scene, state, times, step)):
        longer = _solve(*problem, *how, _LONGER * step, asked.max_solver_steps, chosen)
        _warn_of_long_steps(swung, float(step), longer)
    return swung


def _check_joints(scene: LinkageScene, state: LinkageState) -> None:
    """Refuses a start whose joints are far open; what is traced, or a batch, is not looked at."""
    joints = scene.linkage.joints
    pins = [joint.point_1 for joint in joints]
    pins += [joint.point_2 for joint in joints if joint.body_2 is not None]
    start = scene, state
    if not pins or is_traced(start) or any(map(jnp.ndim, jtu.tree_leaves(start))):
        return
    arm = max(float(np.hypot(*pin)) for pin in pins)
    off = float(_distance(constraints_of(scene.linkage, *state)))
    if arm > 0.0 and off > _FAR * arm:
        raise ArgumentError(
            f"state is {off:.3g} m off its joints: give a start on its constraints, or nearer than "
            f"{_FAR:g} times the longest arm from a centre of mass to a joint, {arm:.3g} m."
        )


def _warn_of_long_steps(
    swung: Trajectory[LinkageState], dt: float, other: Trajectory[LinkageState]
) -> None:
    """Warns where steps of one size are too long: others lead elsewhere."""
    if swung.outcome is not Ending.FINISHED:
        return
    change = 0.0
    for course, found in zip(swung.state, other.final, strict=True):
        size = np.max(np.abs(np.array(course)))
        apart = np.max(np.abs(np.array(course)[:, -1] - np.array(found)))
        change = max(change, float(apart / size) if size > 0.0 else 0.0)
    if not change <= _LONG:
        warn(
            f"dt = {dt:g} is too long: with steps of {_LONGER * dt:g} s the relative change of the "
            f"final state is {change:.2g}; take shorter steps, or tolerances.",
        )


@cached_jit
def _solve(
    scene: LinkageScene,
    state: LinkageState,
    times: Scalar,
    solver: diffrax.AbstractSolver[PyTree],
    control: StepControl | None,
    dt: Scalar | None,
    most: int,
    adjoint: diffrax.AbstractAdjoint,
) -> Trajectory[LinkageState]:
    solver = with_projection(Swinging(), scene, solver, adjoint)
    off, start = _begin(scene, state)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(Swinging.vector_field),
        solver,
        t0=jnp.zeros_like(times[0]),
        t1=times[-1],
        dt0=first_step(times[-1]) if control is not None else dt,
        y0=start,
        args=scene,
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.ConstantStepSize() if control is None else control,
        max_steps=most,
        adjoint=adjoint,
        throw=False,
    )
    found: PyTree = solution.ys
    finite = jnp.isfinite(sum(leaf[-1] for leaf in jtu.tree_leaves(found)))
    out_of_steps = jnp.asarray(solution.result == diffrax.RESULTS.max_steps_reached)
    done = finite & jnp.asarray(solution.result == diffrax.RESULTS.successful)
    ending = jnp.where(out_of_steps, int(Ending.OUT_OF_STEPS), int(Ending.SOLVER_FAILED))
    return Trajectory(
        t=jnp.asarray(solution.ts),
        state=found,
        ending=jnp.where(done, int(Ending.FINISHED), ending),
        accepted=solution.stats["num_accepted_steps"],
        rejected=solution.stats["num_rejected_steps"],
        correction=off,
        violation=_violation(scene, found),
    )


def _lane_request(
    problem: tuple[LinkageScene, LinkageState, Scalar],
    solver: diffrax.AbstractSolver[PyTree],
    tolerance: tuple[Scalar, Scalar],
    dt: Scalar | None,
    asked: Options,
) -> Request | None:
    """What a solve asks of lanes; None where they cannot do it."""
    scene, state, times = problem
    stepper = stepper_of(solver)
    if (
        stepper is None
        or engine_for("auto", obstacle=lane_obstacle(solver, None, problem)) != "lanes"
    ):
        return None
    zero, until = as_float(0.0), times[-1]
    solve = Solve(
        scene=scene,
        state=state,
        duration=until,
        almost=just_before_end(until),
        rtol=tolerance[0],
        atol=tolerance[1],
        units=Units(jtu.tree_map(jnp.ones_like, state), np.ones(())),
        footsteps=zero,
        patience=zero,
        max_attempts=as_float(asked.max_solver_steps),
        steps=None if dt is None else StepsOfOneSize.of(dt, until),
    )
    steps = AdaptiveSolve(Swinging(), stepper, (), counting=False, recorder=TimeRecorder())
    request = Request(adaptive_program(steps), solve, times=np.asarray(times))
    return None if LANES.can(request) else request


def _with_steps(request: Request, dt: Scalar) -> Request:
    """The same with steps of another size [s]."""
    solve = request.inputs
    steps = StepsOfOneSize.of(dt, solve.duration)
    return request._replace(inputs=solve._replace(steps=steps))


def _by_lanes(
    problem: tuple[LinkageScene, LinkageState, Scalar], request: Request
) -> Trajectory[LinkageState]:
    scene, state, _ = problem
    off, start = _begin(scene, state)
    request = request._replace(inputs=request.inputs._replace(state=start))
    solved, recorded, _ = LANES.run(request)
    assert recorded is not None
    saved = arrivals_among(recorded.values, jnp.asarray(recorded.counts), state)
    code = jnp.where(solved.ending == int(Ending.WALKING), int(Ending.FINISHED), solved.ending)
    return Trajectory(
        t=saved.t,
        state=saved.state,
        ending=code,
        accepted=solved.accepted,
        rejected=solved.rejected,
        correction=off,
        violation=_violation(scene, saved.state),
        engine="lanes",
    )


@cached_jit
def _begin(scene: LinkageScene, state: LinkageState) -> tuple[Scalar, LinkageState]:
    """How far a start is from its constraints [m], and the nearest one on them."""
    off = _distance(constraints_of(scene.linkage, *state))
    return off, LinkageState(*map(tuple, nearest_consistent(scene.linkage, *state)))


@cached_jit
def _violation(scene: LinkageScene, state: LinkageState) -> Scalar:
    """Distances of states from the constraints [m], shaped as their leaves."""
    return _distance(constraints_of(scene.linkage, *state))


def _distance(at: Constraints) -> Scalar:
    squares = [value * value for value in at.violation]
    return jnp.sqrt(sum(squares[1:], squares[0])) if squares else jnp.zeros(())

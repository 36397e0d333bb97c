"""Simulation of a scene from a start: the door for every kind of scene, and its short names."""

import warnings
from collections.abc import Callable
from typing import Any, Literal

import diffrax
from jaxtyping import Array, PyTree

from jaxbiped._checks import check_type
from jaxbiped._jax_versions import without_switches
from jaxbiped._types import Parameter
from jaxbiped.dynamics._linkage_motion import LinkageState
from jaxbiped.dynamics._section import AbstractSection, HeelStrike
from jaxbiped.scene._linkages import LinkageScene
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import RigidState
from jaxbiped.simulate._accurate_walk import (
    accurate_walk,
    check_accurate_walk,
    warn_of_long_steps,
    warn_of_missed_contacts,
)
from jaxbiped.simulate._linkage_simulation import simulate_linkage
from jaxbiped.simulate._rigid_simulation import RigidSimulation
from jaxbiped.simulate._simulation import Simulation
from jaxbiped.simulate._start import Options
from jaxbiped.solve._accuracy import unresolved_slip
from jaxbiped.solve._failure_events import WATCHES
from jaxbiped.solve._trajectory import Trajectory


@without_switches
def simulate(
    scene: Scene | RedundantScene | RigidScene | LinkageScene,
    state: PyTree,
    *,
    duration: float | None = None,
    footsteps: int | None = None,
    solver: str | diffrax.AbstractSolver[PyTree] = "rodas4p",
    accuracy: str | float = "balanced",
    rtol: float | None = None,
    atol: float | None = None,
    dt: float | None = None,
    save: Literal["steps", "end"] | Array | AbstractSection | None = None,
    max_arrivals: int = 64,
    extremes: Callable[..., PyTree] | None = None,
    watch: tuple[str, ...] = WATCHES,
    max_solver_steps: int = 65536,
    adjoint: diffrax.AbstractAdjoint | None = None,
    engine: str = "auto",
) -> Trajectory[Any]:
    """Simulates a scene from a state, for a time, a number of footsteps, or whichever ends first.

    Works under `jit`, `vmap` and differentiation; one lane that falls or fails neither changes nor
    holds up the others. Under any of these a trajectory saved step by step keeps its full length
    of `max_solver_steps + 1`, filled with infinities: save only the end of large batches.

    First derivatives of times and states, in both modes and by every engine, follow the event that
    ends or saves the motion; NaN where it is grazed. There are none of `save="steps"`.

    Args:
        scene: what to simulate; a `RedundantScene` for coordinates of each leg. For a `RigidScene`
            and a `LinkageScene` see `rigid_walk` and `swing`, whose options alone apply; the first
            saves "end" or `HeelStrike()`, the second an array of times.
        state: start, a `State`; where friction has bristles also a `BristleState`, for their
            part (zero unless given). Its dtype, that of the most precise leaf, is the precision
            of the solve: 64 bits unless the user says otherwise. A redundant scene also takes a
            redundant state, which is put on its constraints first (see `consistent_state`).
        duration: simulated time [s].
        footsteps: how many (heel strikes) to end after; with a `duration`, too, the simulation
            ends at whichever comes first, and is "walking" either way.
        solver: a name (see `SOLVERS`) or any diffrax solver.
        accuracy: "draft", "balanced" or "tight" (see `ACCURACIES`), or finer where that would not
            resolve the slip speed over which friction builds up. Or a number: the relative error
            wanted of every state and time that is returned, lengths in units of the legs' l,
            times of √(l/g), angles of 1 rad. The walk is then solved at a looser tolerance and
            by a second method as well, and again more tightly until its error bars meet the
            number; its `error` has them. A `RuntimeWarning` tells where they cannot.
        rtol: relative tolerance, in place of the accuracy's; a `RuntimeWarning` tells where it is
            a thousand times coarser than what resolves how friction builds up.
        atol: absolute tolerance (SI), in place of a hundredth of the relative one: for the seed's
            leg length and gravity in SI, for a walker of another size in proportion to that.
        dt: steps of this size [s], in place of tolerances; explicit methods fail on stiff contact
            unless it is about 1e-6, and their derivatives unless it is half of that: friction's
            rate, up to 5e6 1/s, makes a longer Euler step unstable, which the state survives
            because friction saturates, and derivatives do not. Outside of `jit`, `vmap` and
            derivatives the walk is solved twice more, by steps 2 and √2 times as long (where there
            are few, a half and a third as long), and a `RuntimeWarning` tells where one of these
            leads elsewhere; so does one where the walk's own steps missed contacts.
        save: "steps" for every step and the continuous solution, "end" for the final state, an
            array of increasing times [s], shape (n,), at which to save, or a section (by lanes
            only), whose `arrivals` to save beside the final state: `HeelStrike()` saves the
            footsteps. The legs take turns there as in `return_map`, but the states saved keep
            their own names. None for "steps", or of a `RigidScene` for "end".
        max_arrivals: how many arrivals at a section there is room for.
        extremes: a function of (scene, state) whose least and largest values, number by number,
            over the ends of all steps are wanted.
        watch: which failures end the solve: any of "fall", "stop", "stumble".
        max_solver_steps: cap on the solver's attempted steps.
        adjoint: one of diffrax's, to differentiate the steps that were taken instead of the motion,
            with a `RuntimeWarning`: through contact such derivatives may be wrong in every digit.
            Where a method projects after each step, only adjoints that see the steps are allowed.
        engine: "xla", "lanes", "cuda" or "auto" (see `ENGINES`). Results of "xla" agree with the
            others' to within the tolerance, not bit by bit, nor are their steps the same: rounding
            decides on them.

    Returns:
        The motion, and how it ended.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled.

    Examples:
        >>> import jaxbiped as jb
        >>> walk = jb.simulate(
        ...     jb.seed_scene(), jb.seed_state(), duration=0.1, save="end", engine="lanes"
        ... )
        >>> str(walk.outcome), float(walk.t[-1])
        ('walking', 0.1)
    """
    usual = "end" if isinstance(scene, RigidScene) else "steps"
    asked = Options(
        duration=duration,
        footsteps=footsteps,
        solver=solver,
        accuracy=accuracy,
        rtol=rtol,
        atol=atol,
        dt=dt,
        save=usual if save is None else save,
        max_arrivals=max_arrivals,
        extremes=extremes,
        watch=watch,
        max_solver_steps=max_solver_steps,
        adjoint=adjoint,
        engine=engine,
    )
    if isinstance(scene, LinkageScene):
        return simulate_linkage(scene, state, asked)
    wanted = check_accurate_walk(accuracy, rtol=rtol, atol=atol, dt=dt)
    if wanted is not None:
        asked = asked._replace(accuracy="balanced")
    if isinstance(scene, RigidScene):
        rolls = RigidSimulation.of(scene, state, asked)
        return rolls() if wanted is None else accurate_walk(rolls, wanted)
    run = Simulation.of(scene, state, asked)
    if wanted is not None:
        return accurate_walk(run, wanted)
    if rtol is not None and dt is None and (said := unresolved_slip(rtol, scene.minimal)):
        warnings.warn(f"{said}.", RuntimeWarning, stacklevel=2)
    walk = run()
    if dt is not None:
        warn_of_missed_contacts(run, walk)
        warn_of_long_steps(run, walk)
    return walk


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
    check_type("scene", scene, RigidScene)
    return simulate(
        scene,
        state,
        footsteps=footsteps,
        duration=duration,
        accuracy=accuracy,
        rtol=rtol,
        save=HeelStrike() if max_arrivals else "end",
        max_arrivals=max_arrivals if max_arrivals else 1,
        max_solver_steps=max_solver_steps,
        engine=engine,
    )


def swing(
    scene: LinkageScene,
    state: LinkageState,
    *,
    times: Parameter,
    solver: str | diffrax.AbstractSolver[PyTree] = "rodas4",
    accuracy: str = "balanced",
    rtol: float | None = None,
    atol: float | None = None,
    dt: float | None = None,
    max_solver_steps: int = 65536,
    adjoint: diffrax.AbstractAdjoint | None = None,
) -> Trajectory[LinkageState]:
    """Simulates a linkage from a start, which is first put on its constraints.

    Works under `jit`, `vmap` and differentiation.

    Args:
        scene: linkage, constraint method and gravity.
        state: start at time 0, on its constraints or near them.
        times: when to save, increasing from 0 on [s], shape (n,); the last one ends the solve.
        solver, accuracy, rtol, atol, dt, max_solver_steps, adjoint: as in `simulate`.

    Returns:
        States at the `times`, and how far each is off its constraints, leaves of shape (n,). Its
        `ending` is "finished", "out of steps" or "solver failed".

    Raises:
        ArgumentError: an argument that is not allowed, or constraints that the method cannot hold,
            before anything is compiled.
    """
    check_type("scene", scene, LinkageScene)
    return simulate(
        scene,
        state,
        save=times,
        solver=solver,
        accuracy=accuracy,
        rtol=rtol,
        atol=atol,
        dt=dt,
        max_solver_steps=max_solver_steps,
        adjoint=adjoint,
    )

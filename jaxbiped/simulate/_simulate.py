"""Simulation of a scene from a start: the door for every kind of scene, and its short names."""

from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any, Literal, TypeAlias

import diffrax
from jaxtyping import Array, PyTree

from jaxbiped._checks import (
    check_finite,
    check_function,
    check_increasing,
    check_not_negative,
    check_type,
    warn,
)
from jaxbiped._jax_versions import without_switches
from jaxbiped._types import Parameter
from jaxbiped.hybrid._endings import WATCHES
from jaxbiped.hybrid._motion_costs import Integral
from jaxbiped.hybrid._scales import is_stiff, unresolved_slip
from jaxbiped.hybrid._sections import AbstractSection, HeelStrike
from jaxbiped.scene._linkage_scene import LinkageScene, LinkageState
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.scene._state_types import RigidState
from jaxbiped.simulate._abstract_simulation import AbstractSimulation
from jaxbiped.simulate._accurate_walk import (
    accurate_walk,
    check_accurate_walk,
    warn_of_long_steps,
    warn_of_missed_contacts,
)
from jaxbiped.simulate._rigid_simulation import RigidSimulation
from jaxbiped.simulate._simulation import Simulation
from jaxbiped.simulate._start import Options, last_time
from jaxbiped.simulate._trajectory import Trajectory

AnyIntegral: TypeAlias = Integral | str
Integrals: TypeAlias = (
    AnyIntegral | Mapping[str, AnyIntegral] | Set[AnyIntegral] | Sequence[AnyIntegral]
)
"""Integrals by name, or as many as are asked for."""


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
    integrals: Integrals | None = None,
    watch: tuple[str, ...] = WATCHES,
    max_solver_steps: int = 65536,
    adjoint: diffrax.AbstractAdjoint | None = None,
    engine: str = "auto",
) -> Trajectory[Any]:
    """Simulates a scene from a state, for a time, a number of footsteps, or until the first of
    both.

    Works under `jit`, `vmap` and differentiation; a simulation that falls or fails neither changes
    nor delays the others of its batch. Under any of these, a trajectory saved step by step has the
    full length `max_solver_steps + 1`, filled up with infinities, so save only the end of large
    batches.

    First derivatives of times and states, in both modes and with every engine, account for the time
    of the event that ends or saves the motion. They are NaN if the event is grazed, and are not
    available with `save="steps"`.

    Args:
        scene: the scene; a `RedundantScene` for coordinates of each body. For a `RigidScene`,
            `atol` and `adjoint` do not apply; for a `LinkageScene`, `footsteps` does not.
        state: start, a `State`; if friction has bristles, also a `BristleState` (in a `State`, they
            are zero). The precision of the solve is that of the most precise leaf, by default 64
            bits. A redundant scene also accepts a redundant state, which is first moved onto its
            constraints (see `consistent_state`), as a linkage's is, and always has 64 bits.
        duration: simulated time [s]. None without `footsteps`: the last of the times to save at.
        footsteps: number of footsteps (heel strikes) to simulate. If `duration` is also given, the
            first limit that is reached ends the walk; its outcome is "walking" in both cases.
        solver: a name (see `SOLVERS`) or any diffrax solver. On rigid feet, where motion is smooth
            between impacts, an explicit one of these; by default that of order 8, "dopri8".
        accuracy: "draft", "balanced" or "tight" (see `ACCURACIES`); the tolerance is finer if
            necessary to resolve the slip speed over which friction builds up. Or a number: the
            relative error requested of every state and time that is returned, in units of the legs'
            l, √(l/g) and 1 rad. The walk is then also solved at a looser tolerance and with a
            second method, and repeated at finer tolerances until its error bars meet the number.
            The result's `error` has the error bars, and a `RuntimeWarning` is issued if they do not
            meet the number.
        rtol: relative tolerance, instead of an accuracy. A `RuntimeWarning` is issued if it is at
            least a thousand times coarser than needed to resolve how friction builds up.
        atol: absolute tolerance (SI units). Default: a hundredth of the relative one, scaled with
            the size of the walker relative to the seed's.
        dt: fixed step size [s], instead of tolerances. On stiff contact, explicit methods need
            steps of about 1e-6 s, and of half that size for derivatives: friction's rate of up to
            5e6 1/s makes a longer Euler step unstable, which the state survives because friction
            saturates, but derivatives do not. Outside of `jit`, `vmap` and derivatives, the walk is
            solved twice more, with steps 2 and √2 times as long (if there are few steps, a half and
            a third as long). A `RuntimeWarning` is issued if one of these solves disagrees, or if
            the walk's own steps missed contacts.
        save: "steps" for every step and the continuous solution; "end" for the final state; an
            array of increasing times [s], shape (n,); or a section, whose `arrivals` are saved
            beside the final state: `HeelStrike()` saves the footsteps. At a section, the legs take
            turns as in `return_map`, but the saved states keep the names of their legs. None:
            "steps", or "end" for a `RigidScene`, whose legs exchange their names at every heel
            strike; a state saved at that time is the one before the impact.
        max_arrivals: maximum number of arrivals at a section to save.
        extremes: a function of (scene, state); the result has the smallest and largest value of
            each number that it returns, over the ends of all steps, and on both sides of an impact.
        integrals: integrals along the motion, which the result has by name: names of integrals (see
            `jaxbiped.optimise.NAMED_COSTS`) and `jaxbiped.optimise.Integral` objects, or these by
            names of your own. They have no derivatives here; those of a gait's cycle do.
        watch: failures that end the solve: any of "fall", "stop", "stumble".
        max_solver_steps: maximum number of attempted solver steps.
        adjoint: an adjoint of diffrax, to differentiate the steps that were taken instead of the
            motion. A `RuntimeWarning` is issued, because through contact such derivatives may be
            wrong in every digit. If a constraint method projects after each step, only adjoints
            that see the steps are allowed.
        engine: "xla", "lanes", "cuda" or "auto" (see `ENGINES`). Results of "xla" agree with those
            of the others to within the tolerance, but not bit by bit; rounding changes the steps
            too.

    Returns:
        The motion, with its outcome.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.

    Examples:
        >>> import jaxbiped as jb
        >>> walk = jb.simulate(
        ...     jb.seed_scene(), jb.seed_state(), duration=0.1, save="end", engine="lanes"
        ... )
        >>> str(walk.outcome), float(walk.t[-1])
        ('walking', 0.1)
    """
    if extremes is not None:
        check_function("extremes", extremes)
    if adjoint is not None:
        check_type("adjoint", adjoint, diffrax.AbstractAdjoint)
    usual = "steps" if is_stiff(scene) else "end"
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
        integrals=integrals,
        watch=watch,
        max_solver_steps=max_solver_steps,
        adjoint=adjoint,
        engine=engine,
    )
    if duration is None and footsteps is None:
        asked = asked._replace(duration=last_time(asked))
    wanted = check_accurate_walk(accuracy, rtol=rtol, atol=atol, dt=dt)
    if wanted is not None:
        asked = asked._replace(accuracy="balanced")
    kind: type[AbstractSimulation] = Simulation if is_stiff(scene) else RigidSimulation
    run = kind.of(scene, state, asked)
    if wanted is not None:
        return accurate_walk(run, wanted)
    if rtol is not None and dt is None and (said := unresolved_slip(rtol, scene.minimal)):
        warn(f"{said}.")
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
    """Simulates a rigid walker for a number of footsteps, for a time, or until the first of both.

    The solver takes explicit steps of eighth order (Dormand and Prince) under error control. Heel
    strikes and falls are located as roots of each step's interpolant, even two within one step, and
    refined by Newton's method. A foot that reaches the ground, or misses it, by less than the
    tolerance resolves does not strike; `grazes` counts these events. Works under `jit`, `vmap` and
    first derivatives, which account for the times of the strikes and of the end.

    Args:
        scene: the walker.
        state: start, with leg 2 standing.
        footsteps: number of heel strikes to simulate. If `duration` is also given, the first limit
            that is reached ends the walk.
        duration: simulated time [s].
        accuracy: "draft" (1e-4), "balanced" (1e-6) or "tight" (1e-11): the relative tolerance; the
            absolute one (SI) is a hundredth of it. Or a number: the relative error requested of
            every state and time that is returned, in units of the legs' l, √(l/g) and 1 rad, as in
            `simulate`. The result's `error` then has the error bars, and a `RuntimeWarning` is
            issued if they do not meet the number.
        rtol: relative tolerance, instead of an accuracy.
        max_arrivals: maximum number of heel strikes to save.
        max_solver_steps: maximum number of attempted steps.
        engine: "xla", "lanes", "cuda" or "auto" (see `ENGINES`).

    Returns:
        The final time, state and outcome; after a footstep, the state is that just after the
        impact, with leg 2 standing. `arrivals` counts the heel strikes and holds the first
        `max_arrivals`.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.

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
    """Simulates a linkage from a start, which is first moved onto its constraints.

    Works under `jit`, `vmap` and differentiation.

    Args:
        scene: linkage, constraint method and gravity.
        state: start at time 0, on its constraints or near them.
        times: times at which to save, increasing from 0 [s], shape (n,); the last one ends the
            solve.
        solver, accuracy, rtol, atol, dt, max_solver_steps, adjoint: as in `simulate`.

    Returns:
        States at the `times`, and the violation of the constraints by each, leaves of shape (n,).
        Its `ending` is "finished", "out of steps" or "solver failed".

    Raises:
        ArgumentError: an argument is not allowed, or the method cannot hold the constraints; raised
            before anything is compiled.
    """
    check_type("scene", scene, LinkageScene)
    check_finite("times", times)
    check_increasing("times", times, 1)
    check_not_negative("times", times, "s")
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

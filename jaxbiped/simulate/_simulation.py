"""Checked request to simulate, which can be compiled and run at other tolerances."""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, ArrayLike, PyTree

from jaxbiped._checks import (
    check_choice,
    check_positive,
    check_room,
    check_unbatched,
    traced_rules,
    warn,
)
from jaxbiped._types import Numbers, Scalar, as_array, is_traced
from jaxbiped.compiler import BY_NAME, Request
from jaxbiped.hybrid._linkage_system import ADAPTIVE_SCENES
from jaxbiped.hybrid._scales import Units, resolve_slip_speed, si_units, units_of
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene._scene_checks import check_scene, where_allowed
from jaxbiped.simulate._backends import (
    by_lanes,
    by_xla,
    choose_engine,
    lane_request,
    prepare_lanes,
    trim,
)
from jaxbiped.simulate._derivatives import Slopes, slopes_of, with_derivatives
from jaxbiped.simulate._start import (
    Options,
    check_limits,
    check_steps,
    check_times,
    watched_by,
)
from jaxbiped.simulate._trajectory import Trajectory, scene_key
from jaxbiped.solve._accuracy import tolerances
from jaxbiped.solve._error_estimate import LOOSER
from jaxbiped.solve._solvers import check_adjoint, solver_named
from jaxbiped.solve.controllers._event_steps import PATIENCE
from jaxbiped.solve.rosenbrock._rodas_tableaux import Rodas4P, Rodas5P
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

_FIRST = 1e-2
"""First tolerance as a share of the relative error wanted: errors of walks are about 0.5 to 6
tolerances (the seed's walk of two seconds, 1e-5 to 1e-9), and bars some fifteen times that."""
_FINEST_FIRST = 1e-10
"""Finest tolerance to begin with."""
_AS_FINE = 2.0
"""Weight of a witness whose own error is about the walk's: their difference may be either's.

Weight and share were chosen on 1000 random scenes (draw 23 of `experiments/accuracy_coverage.py`):
without them every number lay within its bar in 95.1 % of the scenes, with them in 99.1 %."""
_OF_STEPS = (
    "adjoint = … differentiates the steps that were taken, which were chosen for the state alone: "
    "through contact such derivatives may be wrong in every digit. Without it they are right."
)


class Simulation(eqx.Module):
    """A checked request for a simulation: `prepare` makes it, `compile` compiles it.

    Attributes:
        scene, state, duration, rtol, atol, dt, solver, adjoint: as in `simulate`, checked and
            converted to one precision.
        footsteps, watch, max_solver_steps, section, max_arrivals, extremes: as in `simulate`.
        correction: how a start was moved onto its constraints, or None.
        times: times at which to save [s], shape (n,), or None.
        save_steps: whether every step is saved.
        units: scale of each leaf of the state, in which `atol` is measured.
        finest_tolerance: finest relative tolerance that is tried to meet a requested error.
        engine: "xla", "lanes" or "cuda".
        replaceable: whether XLA may replace the lanes engine.
    """

    finest_tolerance: ClassVar[float] = 1e-12
    scene: AbstractScene
    state: PyTree
    correction: PyTree
    duration: Scalar
    times: Array | None
    rtol: Scalar
    atol: Scalar
    units: Units
    dt: Scalar | None
    solver: diffrax.AbstractSolver[PyTree]
    adjoint: diffrax.AbstractAdjoint | None
    footsteps: int | None = eqx.field(static=True)
    save_steps: bool = eqx.field(static=True)
    watch: tuple[str, ...] = eqx.field(static=True)
    max_solver_steps: int = eqx.field(static=True)
    engine: str = eqx.field(static=True)
    replaceable: bool = eqx.field(static=True)
    section: AbstractSection | None = eqx.field(static=True)
    max_arrivals: int = eqx.field(static=True)
    extremes: Callable[..., PyTree] | None = eqx.field(static=True)

    @staticmethod
    def prepare(scene: AbstractScene, state: PyTree, **options: Any) -> "Simulation":
        """Checks the arguments, which are those of `simulate`; an accuracy must be a name."""
        return Simulation.of(scene, state, Options(**options))

    @staticmethod
    def of(scene: AbstractScene, state: PyTree, asked: Options) -> "Simulation":
        """Checks what is asked, and forms it."""
        given, dt, footsteps, times = state, asked.dt, asked.footsteps, asked.times
        section = asked.section
        check_limits(asked.duration, footsteps, asked.max_solver_steps)
        time = PATIENCE * (footsteps or 0) if asked.duration is None else asked.duration
        for name, value in (("rtol", asked.rtol), ("atol", asked.atol)):
            check_unbatched(name, value)
        with traced_rules() as rules:
            scene = check_scene(scene, *ADAPTIVE_SCENES)
            system = system_of(scene)
            asked.refuse(scene, *system.refuses)
            if section is not None:
                system.check_section(scene, section)
            if not scene.redundant:
                state, correction = system.start(scene, state)
            check_positive("duration", time, "s")
            relative, absolute = tolerances(asked.accuracy, asked.rtol, asked.atol, scene)
            method = solver_named(asked.solver)
            check_steps(method, dt, most_steps=asked.max_solver_steps, duration=time)
        if scene.redundant:  # outside: what it compiles makes parts of its own, none of them given
            state, correction = system.start(scene, state)
        # Of a lane that is not allowed nothing is known from the start.
        state, time = where_allowed(rules, state), where_allowed(rules, time, 1.0)
        watch = watched_by(scene, asked.watch)
        if asked.save is None or isinstance(asked.save, str):
            check_choice("save", asked.save, ("steps", "end"))
        check_room("max_arrivals", asked.max_arrivals)
        if times is not None:
            check_times(times, time)
        dtype = jnp.result_type(jtu.tree_leaves(state)[0])
        system.check_start(scene, state, given)
        if system.projects(scene):
            check_adjoint(scene.method, asked.adjoint)

        def cast(leaf: ArrayLike) -> Array:
            if isinstance(leaf, jax.Array):
                return jnp.asarray(leaf, dtype=dtype)
            return as_array(np.array(leaf, dtype))

        def known(leaf: ArrayLike) -> Numbers:
            # As it is where nothing is traced: each array of JAX's costs 0.1 ms.
            return cast(leaf) if isinstance(leaf, jax.core.Tracer) else np.asarray(leaf, dtype)

        # A tolerance that is given is one in SI units.
        units = units_of(scene, state)
        units = units if asked.atol is None else si_units(units)
        scene = scene if dtype == jnp.float64 else jtu.tree_map(cast, scene)
        longest = cast(time)
        chosen = choose_engine(asked, method, (scene, state, longest))
        return Simulation(
            scene=scene,
            state=state,
            correction=correction,
            duration=longest,
            times=None if times is None else cast(times),
            rtol=cast(relative),
            atol=cast(absolute),
            units=jtu.tree_map(known, units),
            dt=None if dt is None else cast(dt),
            solver=method,
            adjoint=asked.adjoint,
            footsteps=None if footsteps is None else int(footsteps),
            save_steps=asked.save_steps,
            watch=watch,
            max_solver_steps=int(asked.max_solver_steps),
            engine=chosen,
            replaceable=asked.engine == "auto" and section is None,
            section=section,
            max_arrivals=int(asked.max_arrivals),
            extremes=asked.extremes,
        )

    def __call__(self) -> Trajectory:
        """Compiles what is not compiled yet, and runs."""
        if self.adjoint is not None:
            if is_traced(self):
                warn(_OF_STEPS)
            walk = _run(self)
        else:
            walk = with_derivatives(self, _run, moving=_moving, slopes=_slopes)
        violation = system_of(self.scene).violation(self.scene, walk.state)
        return dataclasses.replace(walk, scene_key=scene_key(self.scene), violation=violation)

    def at_tolerance(self, rtol: float) -> "Simulation":
        """The same at another relative tolerance; the absolute one changes in proportion."""
        share = float(self.atol) / float(self.rtol)
        both = (jnp.asarray(np.asarray(x, self.rtol.dtype)) for x in (rtol, share * rtol))
        return eqx.tree_at(lambda run: (run.rtol, run.atol), self, tuple(both))

    def with_steps(self, dt: Scalar) -> "Simulation":
        """The same with steps of another fixed size [s]."""
        return dataclasses.replace(self, dt=dt)

    def by_other_method(self) -> tuple["Simulation", float, float]:
        """The same by another method; its tolerance in units of the walk's, and its weight."""
        if isinstance(self.solver, Rodas5P):
            # Rodas4P takes about as many steps as Rodas5P at a ten times looser tolerance.
            return dataclasses.replace(self, solver=solver_named("rodas4p")), LOOSER, 1.0
        return dataclasses.replace(self, solver=solver_named("rodas5p")), 1.0, _AS_FINE

    def first_tolerance(self, wanted: float) -> float:
        """The relative tolerance to begin with where this relative error is wanted."""
        # What cannot be met is told with the error that can: not at once by the finest steps.
        # Coarser than what resolves slip both witnesses may chatter alike.
        resolved = float(resolve_slip_speed(1.0, self.scene.minimal))
        return min(max(_FIRST * wanted, _FINEST_FIRST), float(self.rtol) * 10.0, resolved)

    def lane_request(self) -> Request | None:
        """The program that runs it; None where diffrax does, also for what lanes lack."""
        if self.engine == "xla" and self.section is None and not system_of(self.scene).lands:
            return None
        request = lane_request(self)
        hindered = self.replaceable and BY_NAME[self.engine].can(request) is not None
        return None if hindered else request

    def compile(self) -> "CompiledSimulation":
        """Compiles the solve, so its run can be timed by itself."""
        if (request := self.lane_request()) is not None:
            return CompiledSimulation(prepare_lanes(self, request), self)
        return CompiledSimulation(by_xla.lower(self).compile(), self)


def _run(run: Simulation) -> Trajectory:
    request = run.lane_request()
    return trim(by_xla(run)) if request is None else by_lanes(run, request)


def _moving(run: Simulation) -> tuple[PyTree, PyTree, PyTree]:
    return run.state, run.scene, run.duration if run.times is None else run.times


def _slopes(
    run: Simulation, found: Trajectory, places: tuple[int, ...], active: tuple[int, ...]
) -> Slopes:
    # The columns take the walk's own method of steps, where that is one for them.
    solver = run.solver if isinstance(run.solver, AbstractRosenbrock) else Rodas4P()
    return slopes_of(
        run.scene,
        run.state,
        found,
        until=run.duration if run.times is None else None,
        solver=solver,
        section=run.section,
        rtol=run.rtol,
        places=places,
        active=active,
        device=run.engine == "cuda",
    )


class CompiledSimulation:
    """A compiled request; call it to run."""

    def __init__(self, program: Callable[[Simulation], Trajectory], request: Simulation) -> None:
        self._program, self._request = program, request

    def __call__(self) -> Trajectory:
        """Runs the solve and waits for it."""
        walk = trim(jax.block_until_ready(self._program(self._request)))
        return dataclasses.replace(walk, scene_key=scene_key(self._request.scene))

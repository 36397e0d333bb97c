"""Checked request to simulate, which can be compiled and run at other tolerances."""

import dataclasses
import warnings
from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, ArrayLike, PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_positive,
    check_room,
    check_type,
    check_unbatched,
    traced_rules,
)
from jaxbiped._types import Numbers, Scalar, as_array
from jaxbiped.compiler import Request
from jaxbiped.dynamics._consistent_state import Consistent
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import BristleState, State
from jaxbiped.scene._scene import RedundantScene, Scene
from jaxbiped.scene._scene_checks import check_scene, where_allowed
from jaxbiped.simulate._derivatives import with_derivatives
from jaxbiped.simulate._lane_backend import able_request, by_lanes, choose_engine, prepare_lanes
from jaxbiped.simulate._slopes import Slopes, slopes_of
from jaxbiped.simulate._start import check_start_height, check_steps, check_times, start_for
from jaxbiped.simulate._xla_backend import by_xla, trim
from jaxbiped.solve._accuracy import check_precision, tolerances
from jaxbiped.solve._failure_events import WATCHES
from jaxbiped.solve._projected_solver import check_adjoint
from jaxbiped.solve._scene_key import scene_key
from jaxbiped.solve._solvers import solver_named
from jaxbiped.solve._trajectory import Trajectory
from jaxbiped.solve._units import Units, si_units, units_of
from jaxbiped.solve.controllers._footstep_counter import PATIENCE
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

_OF_STEPS = (
    "adjoint = … differentiates the steps that were taken, which were chosen for the state alone: "
    "through contact such derivatives may be wrong in every digit. Without it they are right."
)


class Simulation(eqx.Module):
    """A checked request to simulate. `prepare` it, then `compile` it to run it apart from that.

    Attributes:
        scene, state, duration, rtol, atol, dt, solver, adjoint: as in `simulate`, checked, all of
            one precision.
        footsteps, watch, max_solver_steps, section, max_arrivals, extremes: as in `simulate`.
        correction: how a redundant start was put on its constraints, or None.
        times: at which to save [s], shape (n,), or None.
        save_steps: whether every step is saved.
        units: scale of each leaf of the state, in which `atol` is measured.
        engine: "xla", "lanes" or "cuda".
        replaceable: whether XLA may take over from lanes.
    """

    scene: Scene | RedundantScene
    state: PyTree
    correction: Consistent | None
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
    def prepare(
        scene: Scene | RedundantScene,
        state: PyTree,
        *,
        duration: float | None = None,
        footsteps: int | None = None,
        solver: str | diffrax.AbstractSolver[PyTree] = "rodas4p",
        accuracy: str = "balanced",
        rtol: float | None = None,
        atol: float | None = None,
        dt: float | None = None,
        save: Any = "steps",
        max_arrivals: int = 64,
        extremes: Callable[..., PyTree] | None = None,
        watch: tuple[str, ...] = WATCHES,
        max_solver_steps: int = 65536,
        adjoint: diffrax.AbstractAdjoint | None = None,
        engine: str = "auto",
    ) -> "Simulation":
        """Checks the arguments, which are those of `simulate`."""
        given = state
        if duration is None and footsteps is None:
            raise ArgumentError("duration = None and footsteps = None: say how long to simulate.")
        if footsteps is not None:
            check_count("footsteps", footsteps)
        allowed_time = PATIENCE * footsteps if footsteps is not None else 0.0
        time = allowed_time if duration is None else duration
        for name, value in (("duration", time), ("rtol", rtol), ("atol", atol)):
            check_unbatched(name, value)
        check_count("max_solver_steps", max_solver_steps)
        with traced_rules() as rules:
            scene = check_scene(scene, Scene, RedundantScene)
            if not scene.redundant:
                state, correction = start_for(scene, state)
            check_positive("duration", time, "s")
            relative, absolute = tolerances(accuracy, rtol, atol, scene)
            method = solver_named(solver)
            check_steps(method, dt, most_steps=max_solver_steps, duration=time)
        if (
            scene.redundant
        ):  # outside: what it compiles makes parts of its own, of which none is given
            state, correction = start_for(scene, state)
        # Of a lane that is not allowed nothing is known from the start.
        state, time = where_allowed(rules, state), where_allowed(rules, time, 1.0)
        check_type("watch", watch, tuple, list)
        for name in watch:
            check_choice("watch", name, WATCHES)
        if isinstance(save, str):
            check_choice("save", save, ("steps", "end"))
        check_room("max_arrivals", max_arrivals)
        section = save if isinstance(save, AbstractSection) else None
        timed = section is None and not isinstance(save, str)
        if timed:
            check_times(save, time)
        dtype = jnp.result_type(jtu.tree_leaves(state)[0])
        check_precision(scene, dtype)
        if isinstance(given, State | BristleState):
            check_start_height(scene, given)
        if isinstance(scene, RedundantScene):
            check_adjoint(scene.method, adjoint)

        def cast(leaf: ArrayLike) -> Array:
            if isinstance(leaf, jax.Array):
                return jnp.asarray(leaf, dtype=dtype)
            return as_array(np.array(leaf, dtype))

        def known(leaf: ArrayLike) -> Numbers:
            # As it is where nothing is traced: each array of JAX's costs 0.1 ms.
            return cast(leaf) if isinstance(leaf, jax.core.Tracer) else np.asarray(leaf, dtype)

        # A tolerance that is given is one in SI units.
        units = units_of(scene, state)
        units = units if atol is None else si_units(units)
        save_steps = isinstance(save, str) and save == "steps"
        scene = scene if dtype == jnp.float64 else jtu.tree_map(cast, scene)
        longest = cast(time)
        chosen = choose_engine(
            engine,
            solver=method,
            save_steps=save_steps,
            adjoint=adjoint,
            leaves=(scene, state, longest),
            dt=dt,
            redundant=scene.redundant,
            times=save,
            section=section,
        )
        return Simulation(
            scene=scene,
            state=state,
            correction=correction,
            duration=longest,
            times=cast(save) if timed else None,
            rtol=cast(relative),
            atol=cast(absolute),
            units=jtu.tree_map(known, units),
            dt=None if dt is None else cast(dt),
            solver=method,
            adjoint=adjoint,
            footsteps=None if footsteps is None else int(footsteps),
            save_steps=save_steps,
            watch=tuple(watch),
            max_solver_steps=int(max_solver_steps),
            engine=chosen,
            replaceable=engine == "auto" and section is None,
            section=section,
            max_arrivals=int(max_arrivals),
            extremes=extremes,
        )

    def __call__(self) -> Trajectory:
        """Compiles what is not compiled yet, and runs."""
        if self.adjoint is not None:
            if any(isinstance(leaf, jax.core.Tracer) for leaf in jtu.tree_leaves(self)):
                warnings.warn(_OF_STEPS, RuntimeWarning, stacklevel=3)
            walk = _run(self)
        else:
            walk = with_derivatives(self, _run, moving=_moving, slopes=_slopes)
        return dataclasses.replace(walk, scene_key=scene_key(self.scene))

    def lane_request(self) -> Request | None:
        """What it asks of lanes or devices; None where XLA runs it."""
        return able_request(self)

    def compile(self) -> "CompiledSimulation":
        """Compiles the solve, so that its run can be timed by itself."""
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
    refused = {
        'save = "steps"': (run.save_steps, 'ask for save="end", an array of times or a section'),
        "extremes": (run.extremes is not None, "only times and states have derivatives"),
        "scene = RedundantScene(…)": (
            run.scene.redundant,
            "simulate scene.minimal, or choose an adjoint of diffrax's",
        ),
    }
    for argument, (is_so, instead) in refused.items():
        if is_so:
            raise ArgumentError(f"{argument} is not allowed under derivatives: {instead}.")
    # The columns take the walk's own method of steps, where that is one for them.
    solver = run.solver if isinstance(run.solver, AbstractRosenbrock) else solver_named("rodas4p")
    assert isinstance(solver, AbstractRosenbrock)
    assert isinstance(run.scene, Scene)
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
        self._program = program
        self._request = request

    def __call__(self) -> Trajectory:
        """Runs the solve and waits for it."""
        walk = trim(jax.block_until_ready(self._program(self._request)))
        return dataclasses.replace(walk, scene_key=scene_key(self._request.scene))

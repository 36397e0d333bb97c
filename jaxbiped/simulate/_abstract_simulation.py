"""Checked request to simulate any kind of motion, which can be run again at other tolerances."""

import abc
import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, Self

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, ArrayLike, PyTree

from jaxbiped._checks import (
    check_choice,
    check_room,
    check_type,
    check_unbatched,
    traced_rules,
    warn,
)
from jaxbiped._types import Scalar, as_array, is_traced
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene_checks import check_scene, where_allowed
from jaxbiped.simulate._derivatives import Slopes, with_derivatives
from jaxbiped.simulate._start import (
    Options,
    check_limits,
    check_steps,
    check_times,
    integrals_asked,
    longest_time,
    watched_by,
)
from jaxbiped.simulate._trajectory import Trajectory, scene_key
from jaxbiped.solve._accuracy import tolerances
from jaxbiped.solve._solvers import check_adjoint
from jaxbiped.solve._step_integrals import StepIntegrals

_OF_STEPS = (
    "adjoint = … differentiates the steps that were taken, which were chosen for the state alone: "
    "through contact such derivatives may be wrong in every digit. Without it they are right."
)


class AbstractSimulation(eqx.Module):
    """A checked request for a simulation. Call it for its trajectory.

    Attributes:
        scene, state, duration, rtol, atol, dt, adjoint: as in `simulate`, checked and converted to
            one precision.
        footsteps, watch, max_solver_steps, section, max_arrivals, extremes, integrals: as in
            `simulate`.
        correction: how a start was moved onto its constraints, or None.
        times: times at which to save [s], shape (n,), or None.
        save_steps: whether every step is saved.
        engine: "xla", "lanes" or "cuda".
        kinds: the scenes that it is for. A property of the class.
        finest_tolerance: finest relative tolerance that is tried to meet a requested error. A
            property of the class.
    """

    kinds: ClassVar[tuple[type, ...]]
    finest_tolerance: ClassVar[float]
    scene: Any
    state: PyTree
    correction: PyTree
    duration: Scalar
    times: Any
    rtol: Scalar
    atol: Scalar
    dt: Scalar | None
    adjoint: diffrax.AbstractAdjoint | None
    footsteps: int | None = eqx.field(static=True)
    save_steps: bool = eqx.field(static=True)
    watch: tuple[str, ...] = eqx.field(static=True)
    max_solver_steps: int = eqx.field(static=True)
    engine: str = eqx.field(static=True)
    section: AbstractSection | None = eqx.field(static=True)
    max_arrivals: int = eqx.field(static=True)
    extremes: Callable[..., PyTree] | None = eqx.field(static=True)
    integrals: StepIntegrals | None = eqx.field(static=True)

    @classmethod
    def of(cls, scene: Any, state: PyTree, asked: Options) -> Self:
        """Checks what is asked, and forms it."""
        given, dt, footsteps, times = state, asked.dt, asked.footsteps, asked.times
        check_type("scene", scene, *cls.kinds)
        system, section = system_of(scene), asked.section
        asked.refuse(scene, *system.refuses)
        method = cls.method_of(asked)
        check_limits(asked.duration, footsteps, asked.max_solver_steps)
        for name, value in (("rtol", asked.rtol), ("atol", asked.atol)):
            check_unbatched(name, value)
        with traced_rules() as rules:
            scene = check_scene(scene, *cls.kinds)
            if section is not None:
                system.check_section(scene, section)
            if not scene.redundant:
                state, correction = system.start(scene, state)
            time = longest_time(scene, asked)
            relative, absolute = tolerances(asked.accuracy, asked.rtol, asked.atol, scene)
            check_steps(method, dt, most_steps=asked.max_solver_steps, duration=time)
        if scene.redundant:  # outside: what it compiles makes parts of its own, none of them given
            state, correction = system.start(scene, state)
        state = system.begun(scene, state)
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

        # In the precision of the start. A scene that is formed anew makes its mechanism anew.
        fields: dict[str, Any] = dict(
            scene=scene if dtype == jnp.float64 else jtu.tree_map(cast, scene),
            state=state,
            correction=correction,
            duration=cast(time),
            times=None if times is None else cast(times),
            rtol=cast(relative),
            atol=cast(absolute),
            dt=None if dt is None else cast(dt),
            adjoint=asked.adjoint,
            footsteps=None if footsteps is None else int(footsteps),
            save_steps=asked.save_steps,
            watch=watch,
            max_solver_steps=int(asked.max_solver_steps),
            section=section,
            max_arrivals=int(asked.max_arrivals),
            extremes=asked.extremes,
            integrals=integrals_asked(scene, asked.integrals),
        )
        return cls.completed(fields, scene, asked, method)

    @classmethod
    @abc.abstractmethod
    def method_of(cls, asked: Options) -> Any:
        """The method of steps that is asked for.

        Raises:
            ArgumentError: a solver that such motions do not take.
        """

    @classmethod
    @abc.abstractmethod
    def completed(cls, fields: dict[str, Any], scene: Any, asked: Options, method: Any) -> Self:
        """The request, from the fields of all, with those that it alone has, of the exact scene.

        Raises:
            ArgumentError: an engine that cannot do what is asked.
        """

    @abc.abstractmethod
    def solved(self) -> Trajectory[Any]:
        """Solves it, without derivatives."""

    @abc.abstractmethod
    def slopes(
        self, found: Trajectory[Any], places: tuple[int, ...], active: tuple[int, ...]
    ) -> Slopes:
        """Derivatives of what was `found`, as `with_derivatives` takes them."""

    @abc.abstractmethod
    def by_other_method(self) -> tuple[Self, float, float]:
        """The same by another method; its tolerance in units of the walk's, and its weight."""

    @abc.abstractmethod
    def first_tolerance(self, wanted: float) -> float:
        """The relative tolerance to begin with where this relative error is wanted."""

    def __call__(self) -> Trajectory[Any]:
        """Compiles what is not compiled yet, and runs."""
        kind = type(self)
        if self.adjoint is not None:
            if is_traced(self):
                warn(_OF_STEPS)
            walk = self.solved()
        else:
            walk = with_derivatives(self, kind.solved, moving=_moving, slopes=kind.slopes)
        violation = system_of(self.scene).violation(self.scene, walk.state)
        return dataclasses.replace(walk, scene_key=scene_key(self.scene), violation=violation)

    def at_tolerance(self, rtol: float) -> Self:
        """The same at another relative tolerance; the absolute one changes in proportion."""
        share = float(self.atol) / float(self.rtol)
        both = (jnp.asarray(np.asarray(x, self.rtol.dtype)) for x in (rtol, share * rtol))
        return eqx.tree_at(lambda run: (run.rtol, run.atol), self, tuple(both))

    def with_steps(self, dt: Scalar) -> Self:
        """The same with steps of another fixed size [s]."""
        return dataclasses.replace(self, dt=dt)


def _moving(run: AbstractSimulation) -> tuple[PyTree, PyTree, PyTree]:
    return run.state, run.scene, run.duration if run.times is None else run.times

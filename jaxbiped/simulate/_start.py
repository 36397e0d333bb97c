"""Start of a simulation, and what else is asked of it, checked."""

from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, PyTree

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_positive,
    check_type,
    check_unbatched,
    holds_somewhere,
)
from jaxbiped._types import Scalar, by_numpy
from jaxbiped.dynamics._walker_motion import WalkerMotion
from jaxbiped.hybrid._endings import WATCHES
from jaxbiped.hybrid._motion_costs import Integral, check_cost, check_has_costs
from jaxbiped.hybrid._named_costs import cost_named
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.solve._step_integrals import StepIntegrals
from jaxbiped.solve.controllers._event_steps import PATIENCE


class Options(NamedTuple):
    """What is asked of a simulation: the keywords of `simulate`, as they are given."""

    duration: float | None = None
    footsteps: int | None = None
    solver: str | diffrax.AbstractSolver[PyTree] = "rodas4p"
    accuracy: Any = "balanced"
    rtol: float | None = None
    atol: float | None = None
    dt: float | None = None
    save: Any = "steps"
    max_arrivals: int = 64
    extremes: Callable[..., PyTree] | None = None
    integrals: Any = None
    watch: tuple[str, ...] = WATCHES
    max_solver_steps: int = 65536
    adjoint: diffrax.AbstractAdjoint | None = None
    engine: str = "auto"

    @property
    def save_steps(self) -> bool:
        """Whether every step is saved."""
        return isinstance(self.save, str) and self.save == "steps"

    @property
    def section(self) -> AbstractSection | None:
        """The section at which to save arrivals."""
        return self.save if isinstance(self.save, AbstractSection) else None

    @property
    def times(self) -> Any:
        """The times to save at, as they are given."""
        return None if isinstance(self.save, str | AbstractSection) else self.save

    def refuse(self, scene: Any, *names: str) -> None:
        """Raises `ArgumentError` for one of these options: they do not apply to such a scene."""
        for name in names:
            value, usual = getattr(self, name), self._field_defaults[name]
            if value is not usual and (usual is None or value != usual):
                kind = type(scene).__name__
                raise ArgumentError(
                    f"{name} = {value!r} is not allowed for a {kind}: leave it out."
                )


def check_limits(
    duration: Scalar | float | None, footsteps: int | None, max_solver_steps: int
) -> None:
    """Raises `ArgumentError` for what cannot end a simulation."""
    if duration is None and footsteps is None:
        raise ArgumentError("duration = None and footsteps = None: give one of them.")
    if footsteps is not None:
        check_count("footsteps", footsteps)
    check_unbatched("duration", duration)
    check_count("max_solver_steps", max_solver_steps)


def longest_time(scene: Any, asked: Options) -> Scalar | float:
    """The duration that is asked for, or the time that bounds the wait for footsteps [s].

    Raises:
        ArgumentError: a duration that is not positive, or ground on which no rigid foot comes down.
    """
    if asked.duration is not None:
        check_positive("duration", asked.duration, "s")
        return asked.duration
    if scene.stiff:
        return PATIENCE * (asked.footsteps or 0)
    wait = system_of(scene).longest_wait(scene)
    longest: Scalar = by_numpy(lambda _, wait: (asked.footsteps or 0) * wait, wait)
    return longest


def watched_by(scene: Any, watch: Any) -> tuple[str, ...]:
    """The failures to watch for: those named; of a hybrid system, by default all of its endings.

    Raises:
        ArgumentError: a name that is none of a failure.
    """
    check_type("watch", watch, tuple, list)
    allowed = system_of(scene).watches
    watch = allowed if tuple(watch) == WATCHES else watch
    for name in watch:
        check_choice("watch", name, allowed)
    return tuple(watch)


def check_steps(
    solver: diffrax.AbstractSolver[PyTree] | None,
    dt: float | None,
    *,
    most_steps: int,
    duration: Scalar | float,
) -> None:
    """Raises `ArgumentError` for steps that a solver cannot make or the cap on steps forbids."""
    if dt is None:
        if isinstance(solver, diffrax.Euler):
            raise ArgumentError(
                "dt = None is not allowed for solver = euler, whose steps have a fixed size: give "
                "it in seconds, such as dt = 1e-6."
            )
        return
    check_unbatched("dt", dt)
    check_positive("dt", dt, "s")
    if holds_somewhere(duration > dt * most_steps):
        raise ArgumentError(
            f"dt = {float(dt):g} is not allowed: {float(duration):g} s of such steps are more than "
            f"max_solver_steps = {most_steps}; simulate less time, or allow more."
        )


def check_times(times: ArrayLike, duration: Scalar | float) -> None:
    """Raises `ArgumentError` unless they increase and lie within the duration [s]."""
    if isinstance(times, jax.core.Tracer) or isinstance(duration, jax.core.Tracer):
        return
    values = _numbers(times)
    allowed = values.ndim == 1 and np.all(np.diff(values) >= 0.0)
    if not allowed or not np.all((values >= 0.0) & (values <= float(duration))):
        raise ArgumentError(
            f"save = {values} is not allowed: it must be increasing times from 0 to {duration} s."
        )


def last_time(asked: Options) -> Any:
    """The last of the times to save at; None where none are given.

    Raises:
        ArgumentError: they are no numbers.
    """
    times = asked.times
    if times is None:
        return None
    values = times if isinstance(times, jax.core.Tracer) else _numbers(times)
    return values[-1] if values.ndim == 1 and len(values) else None


def _numbers(times: ArrayLike) -> np.ndarray:
    """The times to save at as NumPy's numbers; raises `ArgumentError` for what has none."""
    try:
        return np.asarray(times, dtype=float)
    except (TypeError, ValueError):
        raise ArgumentError(
            f'save = {times!r} is not allowed: give "steps", "end", a section or increasing times.'
        ) from None


class WalkIntegrals(NamedTuple):
    """Integrals of a walker's motion by name. Hashable; called for their rates.

    Attributes:
        names: of the integrals, as they are told.
        integrals: what is summed.
    """

    names: tuple[str, ...]
    integrals: tuple[Integral, ...]

    def rates(self, scene: Any, state: PyTree) -> dict[str, Scalar]:
        """The rates at a state."""
        return self._told(scene, lambda integral: integral.rate, state)

    def at_strike(self, scene: Any, state: PyTree) -> dict[str, Scalar]:
        """What a heel strike adds, at the state just before it."""
        return self._told(scene, lambda integral: integral.at_strike, state)

    def at_reset(self, scene: Any, before: PyTree, after: PyTree) -> dict[str, Scalar]:
        """What a reset adds, from the states before and behind it."""
        return self._told(scene, lambda integral: integral.at_reset, before, after)

    def _told(
        self, scene: Any, part: Callable[[Integral], Any], *states: PyTree
    ) -> dict[str, Scalar]:
        motions, told = [WalkerMotion(scene, state) for state in states], {}
        for name, integral in zip(self.names, self.integrals, strict=True):
            function = part(integral)
            value = jnp.zeros_like(states[0][0]) if function is None else function(*motions)
            told[name] = jnp.asarray(value, dtype=jnp.float64)
        return told


def integrals_asked(scene: Any, given: Any) -> StepIntegrals | None:
    """The integrals that a simulation is asked for: names and objects, or objects by name.

    Raises:
        ArgumentError: what is neither, or an integral that the scene cannot have.
    """
    if given is None:
        return None
    given = (given,) if isinstance(given, str | Integral) else given
    check_type("integrals", given, Mapping, Set, Sequence)
    named = isinstance(given, Mapping)
    integrals: dict[str, Integral] = {}
    for each in given:
        asked: Any = given[each] if named else each
        if isinstance(asked, str):
            cost, part = cost_named(asked, "integrals")
            check_has_costs(asked, scene)
            if (lacks := cost.lacks(scene)) is not None:
                raise ArgumentError(
                    f"integrals = {asked!r} is not allowed for this scene: {lacks}."
                )
            asked, name = cost.costs(part)[0][1], asked
            check_type("integrals", asked, Integral)
        else:
            check_type("integrals", asked, Integral)
            check_cost(asked, scene)
            name = asked.name
        integrals[each if named else name] = asked
    own = WalkIntegrals(tuple(integrals), tuple(integrals.values()))
    return StepIntegrals(own.rates, own.at_strike, own.at_reset)

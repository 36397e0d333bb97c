"""Hybrid systems of a user's own: a field, guards and resets, named; and how solves see them."""

import abc
import dataclasses
import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_unbatched
from jaxbiped._ending import FIRST_OF_A_SYSTEM
from jaxbiped._parameter_declaration import check_parameters
from jaxbiped._types import Scalar, Time, any_of, by_numpy, in_64_bits, is_traced, select
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.caching._caches import PROGRAMS, Once, bounded_cache
from jaxbiped.dynamics._mode_changes import SLACK
from jaxbiped.dynamics._state import (
    check_state,
    periods_of,
    state_for,
    turned_difference,
    without_whole_turns,
)
from jaxbiped.hybrid._endings import ending_events
from jaxbiped.hybrid._guards import Guard, Switch
from jaxbiped.hybrid._sections import AbstractSection, Section, chosen_section, section_of
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import WALKER_SCENES, AbstractMinimalScene, RedundantScene

if TYPE_CHECKING:
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar

_ON_SURFACE, _LEAVES, _SOON = 1e-11, 1e-7, 1e-3
"""Value of a guard, in its scale, up to which a reset has left the state on it; the rate, in its
scale and the unit of time, above which it leaves: slower, it would be back before it rises by more
than rounding; and the time, in its unit, after which it is off all the same where only a higher
derivative takes it off, as a body that begins to slide."""
_ASKED_AGAIN = 7
"""Times that guards are asked again behind a reset: it may bring the state to another one."""


class HybridSystem(AbstractMinimalScene):
    """A system of one's own: its parameters are the fields, its motion a field with guards.

    The state is a NamedTuple of scalars. Its class may have, as plain attributes: `cyclic`, names
    of coordinates that only advance and on which no rate depends; `periodic`, the period of each
    coordinate that turns, as a clock does: it grows, and begins again at 0 behind its period;
    `modes`, names of coordinates that are integers, which only resets change; `scales`, the size
    of coordinates that are not of the order of 1; `own_units`, SI units by name.

    Attributes:
        state_type: the class of the states. A property of the class.
        time_unit: size of the times in which the motion changes, in the unit of its time. A
            property of the class.

    Raises:
        ArgumentError: a parameter is not allowed.
    """

    compliant: ClassVar[bool] = False
    state_type: AbstractClassVar[type[Any]]

    def __check_init__(self) -> None:
        check_parameters(self)

    @abc.abstractmethod
    def rates(self, state: Any) -> Any:
        """Rates of change of the coordinates, a state."""

    def guards(self) -> tuple[Guard, ...]:
        """The guards, in the order in which those that are met together act. Default: none."""
        return ()

    def image(self, state: Any) -> Any:
        """The image of a state by a symmetry of the motion, under which a cycle closes.

        Default: the state itself, which closes without any.
        """
        return state

    @property
    def every_guard(self) -> tuple[Guard, ...]:
        """The guards, and behind them one for each periodic coordinate, of its name."""
        turns = periods_of(self.state_type).items()
        return (*self.guards(), *(_turn(name, period) for name, period in turns))

    @property
    def endings(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the guards that end its motions."""
        return tuple(guard.name for guard in self.guards() if guard.ends)

    def guard(self, name: str) -> Guard:
        """The guard of a name.

        Raises:
            ArgumentError: there is none.
        """
        guards = {guard.name: guard for guard in self.every_guard}
        check_choice("guard", name, guards)
        return guards[name]


SCENES = (*WALKER_SCENES, RedundantScene, HybridSystem)
"""Kinds of scenes."""
MINIMAL_SCENES = (*WALKER_SCENES, HybridSystem)
"""Those in minimal coordinates."""


def _turn(name: str, period: float) -> Guard:
    """Where a periodic coordinate begins again."""

    def begin_again(y: Any) -> Any:
        return y._replace(**{name: getattr(y, name) - period})

    return Guard(
        name, lambda y: getattr(y, name) - period, direction=1, reset=begin_again, scale=period
    )


class At(AbstractSection):
    """Where a hybrid system meets one of its guards, or where a periodic coordinate begins again.

    The state there is the one just behind the guard's reset.

    Attributes:
        guard: its name.
    """

    behind_reset: ClassVar[bool] = True
    guard: str = eqx.field(static=True)

    def value(self, args: HybridSystem, y: PyTree) -> Scalar:
        return -args.guard(self.guard).value(y)

    def counts(self, args: HybridSystem, y: PyTree) -> Scalar:
        return jnp.asarray(args.guard(self.guard).is_armed(y))


@chosen_section.register
@section_of.register
def section_of_system(system: HybridSystem, section: Any) -> AbstractSection:
    """A section of a system's motions, checked. Default: at its first guard that resets the state.

    Raises:
        ArgumentError: it is none, or one of walkers, or at a guard that the system has not.
    """
    if section is None:
        resetting = [guard.name for guard in system.every_guard if guard.reset is not None]
        if not resetting:
            raise ArgumentError(
                f"section = None is not allowed for a {type(system).__name__}, none of whose "
                "guards resets the state: give At(GUARD) or a Section."
            )
        return At(resetting[0])
    if isinstance(section, At):
        if system.guard(section.guard).ends:
            raise ArgumentError(
                f"section = {section!r} is not allowed: the motion ends at that guard."
            )
    elif not isinstance(section, Section):
        raise ArgumentError(
            f"section = {section!r} is not allowed for a {type(system).__name__}: give At(GUARD) "
            "or a Section."
        )
    return section


@state_for.register
def start_of_system(system: HybridSystem, state: Any, name: str = "state") -> Any:
    """A start with all numbers in 64 bits, each periodic coordinate within its period.

    Raises:
        ArgumentError: another kind of state, a number that is not finite, or a system whose rates,
            guards or resets are not those of such a state.
    """
    state = within_periods(in_64_bits(check_state(state, type(system).state_type, name)))
    _checked(jtu.tree_structure(system))(lambda: check_parts(system, state))
    if not is_traced((system, state)):
        with jax.ensure_compile_time_eval():
            for coordinate, rate in _rates_at(system, state)._asdict().items():
                if not np.all(np.isfinite(rate)):
                    raise ArgumentError(
                        f"{name} is not allowed: the rate of {coordinate} is {float(rate):g} there."
                    )
    return state


@without_whole_turns.register
def _(system: HybridSystem, state: Any) -> Any:
    return within_periods(state)


def within_periods(state: Any) -> Any:
    """The same start with each periodic coordinate within its period."""
    for coordinate, period in periods_of(state).items():
        turns = by_numpy(lambda numpy, x, p: numpy.floor(x / p), getattr(state, coordinate), period)
        turned = getattr(state, coordinate) - period * turns
        state = state._replace(**{coordinate: turned})
    return state


@cached_jit
def _rates_at(system: HybridSystem, state: Any) -> Any:
    return system.rates(state)


@bounded_cache(PROGRAMS)
def _checked(structure: Any) -> Once[None]:
    """Whether parts of systems of one structure were checked: values decide nothing there."""
    return Once()


def check_parts(system: HybridSystem, state: Any) -> None:
    """Raises `ArgumentError` for rates, guards or resets that are not those of a state."""
    name, guards = type(system).__name__, system.every_guard
    names = [guard.name for guard in guards]
    for twice in {each for each in names if names.count(each) > 1}:
        raise ArgumentError(f"{name} has two guards {twice!r}: give each another name.")
    one = jtu.tree_map(lambda leaf: jnp.zeros((), leaf.dtype), state)

    def check_same(what: str, function: Callable[[Any], Any]) -> None:
        given = eqx.filter_eval_shape(function, one)
        kind = type(one).__name__
        if not isinstance(given, type(one)):
            raise ArgumentError(f"{what} of {name} gives a {type(given).__name__}: give a {kind}.")
        for coordinate, leaf in given._asdict().items():
            if leaf.shape != ():
                raise ArgumentError(
                    f"{what} of {name} gives {coordinate} the shape {leaf.shape}: give a scalar."
                )

    check_same("rates", lambda y: _scalars(system.rates(y)))
    check_same("image", lambda y: _scalars(system.image(y)))
    for guard in guards:
        if guard.reset is not None:
            what = f"the reset of guard {guard.name!r}"
            check_same(what, functools.partial(_reset, guard))
        value = eqx.filter_eval_shape(lambda g, y: jnp.asarray(g.surface(y)), guard, one)
        if value.shape != ():
            raise ArgumentError(
                f"the surface of guard {guard.name!r} of {name} has the shape {value.shape}: it "
                "must be a scalar."
            )


def _scalars(tree: Any) -> Any:
    return jtu.tree_map(jnp.asarray, tree)


class GuardedMotion(AbstractSystem):
    """A hybrid system as solves see it.

    Attributes:
        kind: its class.
        cyclic_coordinates, time_unit: as of `AbstractSystem`.
        watched: numbers and names of the guards that end it.
        at: the guard at which a cycle is observed, which is then no switch; None for another
            section.
    """

    kind: type[HybridSystem] = eqx.field(static=True)
    cyclic_coordinates: tuple[int, ...] = eqx.field(static=True)  # type: ignore[misc]
    time_unit: float = eqx.field(static=True)  # type: ignore[misc]
    watched: tuple[tuple[int, str], ...] = eqx.field(static=True)
    resets: bool = eqx.field(static=True)  # type: ignore[misc]
    at: str | None = eqx.field(static=True, default=None)
    lands: ClassVar[bool] = True
    refuses: ClassVar[tuple[str, ...]] = ("footsteps", "adjoint")

    @property
    def watches(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the guards that end it."""
        return tuple(name for _, name in self.watched)

    def start(self, args: HybridSystem, y: PyTree) -> tuple[PyTree, PyTree]:
        check_unbatched("scene", args, "one system")
        start = start_of_system(args, y)
        check_unbatched("state", start, "one start")
        return start, None

    def check_section(self, args: HybridSystem, section: AbstractSection) -> None:
        section_of_system(args, section)

    def observed_at(self, section: AbstractSection) -> "GuardedMotion":
        if not isinstance(section, At):
            return self
        return dataclasses.replace(self, at=section.guard)

    def vector_field(self, t: Time, y: PyTree, args: HybridSystem) -> PyTree:
        return type(y)(*(jnp.asarray(rate, y[0].dtype) for rate in args.rates(y)))

    def _located(self, args: HybridSystem) -> list[Guard]:
        """The guards that are switches."""
        return [g for g in args.every_guard if not g.ends and g.name != self.at]

    def switches(self, args: HybridSystem, y: PyTree) -> tuple[Switch, ...]:
        return tuple(guard.switch(y) for guard in self._located(args))

    def reset_at_switch(self, args: HybridSystem, y: PyTree, which: Scalar) -> PyTree:
        guards = self._located(args)
        for number, guard in enumerate(guards, 1):
            if guard.reset is not None:
                y = select(jnp.asarray(which == number), _reset(guard, y), y)
        return self._settled(args, y, [g for g in guards if g.reset is not None])

    def _settled(self, args: HybridSystem, y: PyTree, guards: list[Guard]) -> PyTree:
        """The state behind all that resets it at this instant."""
        if len(guards) < 2:
            return y

        def ask(_: Scalar, y: PyTree) -> PyTree:
            for guard in guards:
                y = select(self._stays_on(guard, args, y), _reset(guard, y), y)
            return y

        return jax.lax.fori_loop(0, _ASKED_AGAIN, ask, y)

    def _stays_on(self, guard: Guard, args: HybridSystem, y: PyTree) -> Scalar:
        """Whether a state is on a guard and does not leave it (boolean)."""
        value, rate = jax.jvp(guard.value, (y,), (self.vector_field(jnp.zeros(()), y, args),))
        leaves = rate * self.time_unit > _LEAVES
        leaves = leaves | (guard.value(self._soon(args, y)) > _ON_SURFACE * _SOON)
        return (jnp.abs(value) <= _ON_SURFACE) & ~leaves & guard.is_armed(y)

    def _soon(self, args: HybridSystem, y: PyTree) -> PyTree:
        """The state a little later: a step of the classical Runge-Kutta method."""
        span = _SOON * self.time_unit

        def along(slope: PyTree, share: float) -> PyTree:
            return jtu.tree_map(lambda a, b: a + span * share * b, y, slope)

        def rates(state: PyTree) -> PyTree:
            return self.vector_field(jnp.zeros(()), state, args)

        first = rates(y)
        second = rates(along(first, 0.5))
        third = rates(along(second, 0.5))
        fourth = rates(along(third, 1.0))
        slope = jtu.tree_map(
            lambda a, b, c, d: (a + 2.0 * b + 2.0 * c + d) / 6.0, first, second, third, fourth
        )
        return along(slope, 1.0)

    def unwrapped(self, before: PyTree, after: PyTree) -> PyTree:
        counted = {
            name: old + turned_difference(getattr(after, name) - old, period)
            for name, period in periods_of(after).items()
            for old in (getattr(before, name),)
        }
        return after._replace(**counted)

    def lies_beyond(self, args: HybridSystem, states: PyTree, by: float = SLACK) -> np.ndarray:
        """Whether states are beyond a guard that is armed and resets them, by so much in its scale.

        Leaves have the shape (n,).
        """

        def one(y: PyTree) -> Scalar:
            resetting = [guard for guard in args.guards() if guard.reset is not None]
            beyond = [(guard.value(y) < -by) & guard.is_armed(y) for guard in resetting]
            return any_of([jnp.asarray(False), *map(jnp.asarray, beyond)])

        return np.asarray(jax.vmap(one)(states))

    def repeats(self, args: HybridSystem, y: PyTree) -> Scalar:
        resetting = [guard for guard in self._located(args) if guard.reset is not None]
        return any_of([self._stays_on(guard, args, y) for guard in resetting])

    def on_held(self, args: HybridSystem, y: PyTree) -> PyTree:
        modes = getattr(type(y), "modes", ())
        held = {name: jnp.round(getattr(y, name)) for name in modes}
        return within_periods(y._replace(**held))

    def reset_map(self, args: HybridSystem, y: PyTree) -> PyTree:
        if self.at is not None and (guard := args.guard(self.at)).reset is not None:
            y = _reset(guard, y)
        return args.image(y)

    def arrival(
        self, section: AbstractSection, args: HybridSystem, y: PyTree
    ) -> tuple[Scalar, Scalar]:
        if self.at is None:
            return super().arrival(section, args, y)
        return section.value(args, y), section.counts(args, y)

    def load(self, args: HybridSystem, y: PyTree) -> None:
        return None

    def failures(self, watch: tuple[str, ...]) -> dict[Any, Callable[..., Scalar]]:
        ends = enumerate(self.watched, FIRST_OF_A_SYSTEM)
        passed = {code: _passed(k) for code, (k, name) in ends if name in watch}
        return ending_events(()) | passed

    def ending_surface(self, code: Scalar, args: HybridSystem, past: PyTree, y: PyTree) -> Scalar:
        value = jnp.full(jnp.shape(code), jnp.nan)
        for number, (k, _) in enumerate(self.watched, FIRST_OF_A_SYSTEM):
            value = jnp.where(code == number, -args.guards()[k].value(y), value)
        return value


def _reset(guard: Guard, y: PyTree) -> PyTree:
    assert guard.reset is not None
    behind = guard.reset(y)
    return type(y)(*(jnp.asarray(leaf, y[0].dtype) for leaf in behind))


@bounded_cache(PROGRAMS)  # the same function each time: caches know by it what is compiled
def _passed(number: int) -> Callable[..., Scalar]:
    """Whether the guard of a number that ends the motion is passed, as diffrax asks it."""

    def happens(t: Time, y: PyTree, args: HybridSystem, **kwargs: object) -> Scalar:
        guard = args.guards()[number]
        return jnp.asarray((guard.value(y) < 0.0) & guard.is_armed(y))

    return happens


@system_of.register
def _(scene: HybridSystem) -> AbstractSystem:
    names, guards = scene.state_type._fields, scene.guards()
    cyclic = getattr(scene.state_type, "cyclic", ())
    return GuardedMotion(
        kind=type(scene),
        cyclic_coordinates=tuple(map(names.index, cyclic)),
        time_unit=scene.time_unit,
        watched=tuple((k, guard.name) for k, guard in enumerate(guards) if guard.ends),
        resets=any(guard.reset is not None for guard in scene.every_guard),
    )

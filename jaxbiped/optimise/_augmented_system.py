"""Augmented systems: a walker's state with further coordinates, which it does not know itself.

Integrals over a cycle, a clock, a disturbance.
"""

from collections import namedtuple
from typing import Any, ClassVar

from equinox import AbstractVar
from jaxtyping import PyTree

from jaxbiped._types import Scalar, by_numpy
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.variational._hybrid_system import AbstractSystem

_KINDS: dict[tuple[type, tuple[str, ...]], Any] = {}
"""Of each walker's state the augmented ones: always the same types, or all would compile again."""


def _augmented_type(walker: Any, names: tuple[str, ...]) -> Any:
    if (walker, names) not in _KINDS:
        place, *recurring = walker._fields
        fields: Any = namedtuple("_Augmented", (place, *names, *recurring))  # type: ignore[misc]
        # By this other processes know it, see `jaxbiped.caching._fingerprint`.
        made_by = (_augmented_type, walker, names)
        own: dict[str, Any] = {"__slots__": (), "__made_by__": made_by, "__reduce__": _taken_apart}
        # Whatever they are, their errors count in SI units.
        own["own_units"] = getattr(walker, "own_units", {}) | dict.fromkeys(names, "")
        _KINDS.setdefault((walker, names), type("_Augmented", (fields,), own))
    return _KINDS[walker, names]


def _taken_apart(y: Any) -> tuple[Any, ...]:
    """An augmented state as `pickle` keeps it."""
    _, _, names = type(y).__made_by__
    return _put_together, (motion_of(y), {name: getattr(y, name) for name in names})


def _put_together(motion: Any, coordinates: dict[str, Any]) -> Any:
    return _augmented_type(type(motion), tuple(coordinates))(**coordinates, **motion._asdict())


def augment(state: WalkerState, names: tuple[str, ...]) -> PyTree:
    """A walker's state with coordinates of these names, which begin at zero."""
    zero = by_numpy(lambda numpy, place: numpy.zeros_like(place), state[0])
    return _augmented_type(type(state), names)(**dict.fromkeys(names, zero), **state._asdict())


def motion_of(y: PyTree) -> Any:
    """The walker's own state."""
    _, walker, _ = type(y).__made_by__
    return walker(*(getattr(y, name) for name in walker._fields))


def join(like: PyTree, motion: PyTree, coordinates: dict[str, Scalar]) -> PyTree:
    """A walker's state or rates, and those of the further coordinates, as one."""
    return type(like)(**motion._asdict(), **coordinates)


class AbstractAugmentedSystem(AbstractSystem):
    """A walker with further coordinates.

    Attributes:
        walker: the walker without them, or with others.
        coordinates: their names, as they lie behind the root point's place.
        recurring: how many of them, the last ones, must return.
    """

    walker: AbstractVar[AbstractSystem]
    coordinates: AbstractVar[tuple[str, ...]]
    recurring: ClassVar[int] = 0

    @property
    def cyclic_coordinates(self) -> tuple[int, ...]:  # type: ignore[override]
        """The walker's, and those that need not return."""
        own = len(self.coordinates) - self.recurring
        return tuple(range(own + len(self.walker.cyclic_coordinates)))

    def begin(self, state: WalkerState) -> PyTree:
        """A walker's state with coordinates that begin at zero."""
        inner = (
            self.walker.begin(state) if isinstance(self.walker, AbstractAugmentedSystem) else state
        )
        return augment(inner, self.coordinates)

    def reset_at_switch(self, args: PyTree, y: PyTree) -> PyTree:
        after = self.walker.reset_at_switch(args, motion_of(y))
        return join(y, after, {name: getattr(y, name) for name in self.coordinates})

    def on_held(self, args: PyTree, y: PyTree) -> PyTree:
        there = self.walker.on_held(args, motion_of(y))
        return join(y, there, {name: getattr(y, name) for name in self.coordinates})


class MotionSection(AbstractSection):
    """The walker's own section, of an augmented state.

    Attributes:
        section: of the walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        return self.section.value(args, motion_of(y))

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        return self.section.counts(args, motion_of(y))

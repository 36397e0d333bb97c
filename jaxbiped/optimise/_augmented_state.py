"""Augmented state: a walker's state with further coordinates just behind hip_x.

They are what the walker itself does not know: integrals over a cycle, a clock, a push.
"""

from collections import namedtuple
from typing import Any

from jaxtyping import PyTree

from jaxbiped._types import Scalar, by_numpy
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import WalkerState

_KINDS: dict[tuple[type, tuple[str, ...]], Any] = {}
"""Of each walker's state the augmented ones: always the same types, or all would compile again."""


def _augmented(walker: Any, names: tuple[str, ...]) -> Any:
    if (walker, names) not in _KINDS:
        place, *recurring = walker._fields
        fields: Any = namedtuple("_Augmented", (place, *names, *recurring))  # type: ignore[misc]
        # By this other processes know it, see `jaxbiped.caching._fingerprint`.
        made_by = (_augmented, walker, names)
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
    return _augmented(type(motion), tuple(coordinates))(**coordinates, **motion._asdict())


def augment(state: WalkerState, names: tuple[str, ...]) -> PyTree:
    """A walker's state with coordinates of these names, which begin at zero."""
    zero = by_numpy(lambda numpy, hip_x: numpy.zeros_like(hip_x), state.hip_x)
    return _augmented(type(state), names)(**dict.fromkeys(names, zero), **state._asdict())


def motion_of(y: PyTree) -> Any:
    """The walker's own state."""
    _, walker, _ = type(y).__made_by__
    return walker(*(getattr(y, name) for name in walker._fields))


def joined(like: PyTree, motion: PyTree, coordinates: dict[str, Scalar]) -> PyTree:
    """A walker's state or rates, and those of the further coordinates, as one."""
    return type(like)(**motion._asdict(), **coordinates)


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

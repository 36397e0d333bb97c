"""Augmented state: a walker's state with further coordinates just behind hip_x.

They are what the walker itself does not know: integrals over a cycle, a clock, a push.
"""

from collections import namedtuple
from typing import Any

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.dynamics._rigid_state import WalkerState
from jaxbiped.dynamics._section import AbstractSection

_KINDS: dict[tuple[type, tuple[str, ...]], Any] = {}
"""Of each walker's state the augmented ones: always the same types, or all would compile again."""
_WALKERS: dict[type, Any] = {}
"""The walker's own kind of state, by the augmented one."""


def _augmented(walker: Any, names: tuple[str, ...]) -> Any:
    place, *recurring = walker._fields
    made = namedtuple("_Augmented", (place, *names, *recurring))  # type: ignore[misc]
    kind = _KINDS.setdefault((walker, names), made)
    _WALKERS[kind] = walker
    return kind


def augment(state: WalkerState, names: tuple[str, ...]) -> PyTree:
    """A walker's state with coordinates of these names, which begin at zero."""
    zero = jnp.zeros_like(state.hip_x)
    return _augmented(type(state), names)(**dict.fromkeys(names, zero), **state._asdict())


def motion_of(y: PyTree) -> Any:
    """The walker's own state."""
    walker = _WALKERS[type(y)]
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

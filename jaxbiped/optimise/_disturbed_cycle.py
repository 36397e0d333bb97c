"""Disturbed cycle: the walker pushed along the slope for one cycle, and a clock beside it.

The push is a coordinate that rests during the cycle and is zero behind it, so that the response to
it is a column of the return map's Jacobian, and the response's derivatives a second variation.
"""

import dataclasses
from collections import namedtuple
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._bristle_state import BristleState
from jaxbiped.dynamics._rigid_state import RigidState, WalkerState
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import State
from jaxbiped.dynamics._switches import Switch
from jaxbiped.scene._abstract_scene import AbstractScene
from jaxbiped.variational._hybrid_system import AbstractSystem, system_of


def _disturbed(kind: Any) -> Any:
    place, *recurring = kind._fields
    return namedtuple("_Disturbed", (place, "clock", "push", *recurring))


_KINDS: dict[type, Any] = {kind: _disturbed(kind) for kind in (State, BristleState, RigidState)}
_OWN = {kind: own for own, kind in _KINDS.items()}


def undisturbed(state: WalkerState) -> PyTree:
    """A walker's state without a push, its clock at zero."""
    zero = jnp.zeros_like(state.hip_x)
    return _KINDS[type(state)](**state._asdict(), clock=zero, push=zero)


def motion_of(y: PyTree) -> Any:
    """The walker's own state."""
    own: Any = _OWN[type(y)]
    return own(*(getattr(y, name) for name in own._fields))


def _joined(like: PyTree, motion: PyTree, clock: Scalar, push: Scalar) -> PyTree:
    return type(like)(**motion._asdict(), clock=clock, push=push)


class DisturbedCycle(AbstractSystem):
    """A walker whose weight leans downhill by a push, in units of the weight, for one cycle.

    Attributes:
        walker: the walker, undisturbed.
    """

    cyclic_coordinates: ClassVar[tuple[int, ...]] = (0, 1)
    walker: AbstractSystem

    def vector_field(self, t: Time, y: PyTree, args: AbstractScene) -> PyTree:
        leaning = dataclasses.replace(args.ground, slope=args.ground.slope + y.push)
        pushed = eqx.tree_at(lambda scene: scene.ground, args, leaning)
        rates = self.walker.vector_field(t, motion_of(y), pushed)
        zero = jnp.zeros_like(y.push)
        return _joined(y, rates, zero + 1.0, zero)

    def switches(self, args: AbstractScene, y: PyTree) -> tuple[Switch, ...]:
        return self.walker.switches(args, motion_of(y))

    def ending(self, args: AbstractScene, y: PyTree) -> Scalar:
        return self.walker.ending(args, motion_of(y))

    def reset_map(self, args: AbstractScene, y: PyTree) -> PyTree:
        after = self.walker.reset_map(args, motion_of(y))
        return _joined(y, after, y.clock, jnp.zeros_like(y.push))

    def load(self, args: AbstractScene, y: PyTree) -> None:
        return None


def disturbed(scene: AbstractScene) -> DisturbedCycle:
    """The walker of a scene, which can be pushed."""
    return DisturbedCycle(system_of(scene))


class UndisturbedSection(AbstractSection):
    """The walker's own section, of a state with clock and push.

    Attributes:
        section: of the walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        return self.section.value(args, motion_of(y))

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        return self.section.counts(args, motion_of(y))

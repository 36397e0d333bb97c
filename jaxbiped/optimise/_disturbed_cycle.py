"""Disturbed cycle: the walker pushed along the slope for one cycle, and a clock beside it.

The push is a coordinate that rests during the cycle and is zero behind it, so that the response to
it is a column of the return map's Jacobian, and the response's derivatives a second variation.
"""

import dataclasses
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._state import WalkerState
from jaxbiped.dynamics._switches import Switch
from jaxbiped.optimise._augmented_state import augment, joined, motion_of
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.variational._hybrid_system import AbstractSystem, system_of


def undisturbed(state: WalkerState) -> PyTree:
    """A walker's state without a push, its clock at zero."""
    return augment(state, ("clock", "push"))


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
        return joined(y, rates, {"clock": zero + 1.0, "push": zero})

    def switches(self, args: AbstractScene, y: PyTree) -> tuple[Switch, ...]:
        return self.walker.switches(args, motion_of(y))

    def ending(self, args: AbstractScene, y: PyTree) -> Scalar:
        return self.walker.ending(args, motion_of(y))

    def reset_map(self, args: AbstractScene, y: PyTree) -> PyTree:
        after = self.walker.reset_map(args, motion_of(y))
        return joined(y, after, {"clock": y.clock, "push": jnp.zeros_like(y.push)})

    def load(self, args: AbstractScene, y: PyTree) -> None:
        return None


def disturbed(scene: AbstractScene) -> DisturbedCycle:
    """The walker of a scene, which can be pushed."""
    return DisturbedCycle(system_of(scene))

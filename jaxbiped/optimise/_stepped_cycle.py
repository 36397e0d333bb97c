"""Stepped cycle: the walker whose next footstep comes down on lower ground, and a clock beside it.

The step is a coordinate that rests during the cycle and is zero behind it: from there on heights
are those above the lower ground, so that the response is a column of the return map's Jacobian.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import RigidState, WalkerState
from jaxbiped.dynamics._switches import Switch
from jaxbiped.optimise._augmented_state import MotionSection, augment, joined, motion_of
from jaxbiped.scene._ground import SteppedGround
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.variational._hybrid_system import AbstractSystem, system_of

_APART = 1e-2
"""Sine of half the angle between the legs from which a rigid walker's foot can come down."""


def unstepped(state: WalkerState) -> PyTree:
    """A walker's state on even ground, its clock at zero."""
    return augment(state, ("clock", "fallen", "drop"))


class SteppedCycle(AbstractSystem):
    """A walker whose leg 1 comes down on ground that lies lower by `drop`, in leg lengths.

    Behind the arrival the coordinate is zero and its value is `fallen`: the hip is that much
    higher above the ground. By then the leg behind has left the upper ground.

    Attributes:
        walker: the walker on even ground.
    """

    cyclic_coordinates: ClassVar[tuple[int, ...]] = (0, 1, 2)
    walker: AbstractSystem

    def vector_field(self, t: Time, y: PyTree, args: AbstractScene) -> PyTree:
        rates = self.walker.vector_field(t, motion_of(y), _stepped(args, y))
        zero = jnp.zeros_like(y.drop)
        return joined(y, rates, {"clock": zero + 1.0, "fallen": zero, "drop": zero})

    def switches(self, args: AbstractScene, y: PyTree) -> tuple[Switch, ...]:
        return self.walker.switches(_stepped(args, y), motion_of(y))

    def ending(self, args: AbstractScene, y: PyTree) -> Scalar:
        return self.walker.ending(_stepped(args, y), motion_of(y))

    def reset_map(self, args: AbstractScene, y: PyTree) -> PyTree:
        after = self.walker.reset_map(args, motion_of(y))
        if not isinstance(after, RigidState):
            after = after._replace(hip_z=after.hip_z + y.drop * args.walker.l)
        return joined(
            y, after, {"clock": y.clock, "fallen": y.drop, "drop": jnp.zeros_like(y.drop)}
        )

    def load(self, args: AbstractScene, y: PyTree) -> None:
        return None


class SteppedSection(AbstractSection):
    """The walker's own section; a rigid walker's foot comes down where the ground now is.

    Attributes:
        section: of the walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        if not isinstance(motion_of(y), RigidState):
            return MotionSection(self.section).value(args, y)
        # Feet differ in height by (l − r)(cos θ₁ − cos θ₂), which is a product of two sines.
        apart = jnp.maximum(jnp.sin(0.5 * (y.theta_2 - y.theta_1)), _APART)
        fall = y.fallen * args.walker.l / args.walker.hip_to_foot
        return -2.0 * jnp.sin(0.5 * (y.theta_1 + y.theta_2)) - fall / apart

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        return MotionSection(self.section).counts(args, y)


def _stepped(scene: AbstractScene, y: PyTree) -> AbstractScene:
    """The scene with the step before the swinging leg; a rigid walker's section has it."""
    if not scene.compliant:
        return scene
    ground = SteppedGround(scene.ground.slope, scene.ground.g, y.drop * scene.walker.l)
    found: AbstractScene = eqx.tree_at(lambda each: each.ground, scene, ground)
    return found


def stepped(scene: AbstractScene) -> SteppedCycle:
    """The walker of a scene, before which the ground can have a step."""
    return SteppedCycle(system_of(scene))

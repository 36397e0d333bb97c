"""Augmented cycles: a walker's state with further coordinates, and cycles disturbed by one of them.

Further coordinates are what the walker itself does not know: integrals over a cycle, a clock, a
disturbance. A disturbance rests during the cycle and is zero behind it, so that the response to it
is a column of the return map's Jacobian, and the response's derivatives a second variation: a push
along the slope for one cycle, or ground on which the next footstep comes down lower. Behind that
step heights are those above the lower ground.
"""

import dataclasses
from collections import namedtuple
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from equinox import AbstractVar
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, by_numpy
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import RigidState, WalkerState
from jaxbiped.dynamics._switches import Switch
from jaxbiped.scene._ground import Ground, SteppedGround
from jaxbiped.scene._scene import AbstractWalkerScene
from jaxbiped.variational._hybrid_system import AbstractSystem

_KINDS: dict[tuple[type, tuple[str, ...]], Any] = {}
"""Of each walker's state the augmented ones: always the same types, or all would compile again."""
_APART = 1e-2
"""Sine of half the angle between the legs from which a rigid walker's foot can come down."""
PUSH, DROP = "push", "drop"


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


class AbstractAugmented(AbstractSystem):
    """A walker with further coordinates.

    Attributes:
        walker: the walker without them, or with others.
        coordinates: their names, as they lie behind hip_x.
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
        inner = self.walker.begin(state) if isinstance(self.walker, AbstractAugmented) else state
        return augment(inner, self.coordinates)


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


class DisturbedCycle(AbstractAugmented):
    """A walker that is pushed for one cycle, or whose leg 1 comes down on ground that lies lower.

    `push` is in units of the weight, which leans downhill by it; `drop` in leg lengths. Behind the
    arrival `drop` is zero and its value is `fallen`: the hip is that much higher above the ground.
    By then the leg behind has left the upper ground.

    Attributes:
        walker: the walker, undisturbed.
        coordinates: a clock, and what the disturbance needs.
        disturbance: "push" or "drop".
    """

    walker: AbstractSystem
    coordinates: tuple[str, ...] = eqx.field(static=True)
    disturbance: str = eqx.field(static=True)
    recurring: ClassVar[int] = 1

    def vector_field(self, t: Time, y: PyTree, args: AbstractWalkerScene) -> PyTree:
        rates = self.walker.vector_field(t, motion_of(y), self._scene(args, y))
        zero = jnp.zeros_like(y.clock)
        return joined(y, rates, dict.fromkeys(self.coordinates, zero) | {"clock": zero + 1.0})

    def switches(self, args: AbstractWalkerScene, y: PyTree) -> tuple[Switch, ...]:
        return self.walker.switches(self._scene(args, y), motion_of(y))

    def ending(self, args: AbstractWalkerScene, y: PyTree) -> Scalar:
        return self.walker.ending(self._scene(args, y), motion_of(y))

    def reset_map(self, args: AbstractWalkerScene, y: PyTree) -> PyTree:
        after = self.walker.reset_map(args, motion_of(y))
        told = {"clock": y.clock, self.disturbance: jnp.zeros_like(y.clock)}
        if self.disturbance == DROP:
            told["fallen"] = y.drop
            if not isinstance(after, RigidState):
                after = after._replace(hip_z=after.hip_z + y.drop * args.walker.l)
        return joined(y, after, told)

    def load(self, args: AbstractWalkerScene, y: PyTree) -> None:
        return None

    def _scene(self, scene: AbstractWalkerScene, y: PyTree) -> AbstractWalkerScene:
        """The scene as it is disturbed; the step of a rigid walker is its section's."""
        ground: Ground | SteppedGround
        if self.disturbance == PUSH:
            ground = dataclasses.replace(scene.ground, slope=scene.ground.slope + y.push)
        elif scene.compliant:
            ground = SteppedGround(scene.ground.slope, scene.ground.g, y.drop * scene.walker.l)
        else:
            return scene
        found: AbstractWalkerScene = eqx.tree_at(lambda each: each.ground, scene, ground)
        return found


def push_cycle(walker: AbstractSystem) -> DisturbedCycle:
    """A walker that can be pushed."""
    return DisturbedCycle(walker, ("clock", PUSH), PUSH)


def drop_cycle(walker: AbstractSystem) -> DisturbedCycle:
    """A walker before which the ground can have a step."""
    return DisturbedCycle(walker, ("clock", "fallen", DROP), DROP)


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

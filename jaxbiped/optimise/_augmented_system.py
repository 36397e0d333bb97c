"""Augmented systems: a walker's state with further coordinates, which it does not know itself.

An integral (slip, losses, motors' work) is a coordinate whose rate is the integrand, and on which
no rate depends: in a cycle it gains that. The return map then has its value, its derivatives and
their errors from one solve.

A disturbance rests during the cycle and is zero behind it, so that the response to it is a column
of the return map's Jacobian, and the response's derivatives a second variation: a push along the
slope for one cycle, or ground on which the next footstep comes down lower. Behind that step heights
are those above the lower ground. Another coordinate tells where a swing foot is lowest.
"""

import dataclasses
import functools
from collections import namedtuple
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, by_numpy, select
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._equivalent_states import exchange_legs
from jaxbiped.dynamics._surfaces import clearance, clearance_rate, distance_ahead
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.scene._ground import Ground, SteppedGround
from jaxbiped.scene._scene import AbstractWalkerScene, RigidScene
from jaxbiped.scene._state_types import WalkerState

_KINDS: dict[tuple[type, tuple[str, ...]], Any] = {}
"""Of each walker's state the augmented ones: always the same types, or all would compile again."""
_APART = 1e-2
"""How far ahead a rigid walker's foot is that can come down, as a share of the walker's height."""
PUSH, DROP = "push", "drop"


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

    walker: AbstractSystem
    coordinates: tuple[str, ...] = eqx.field(static=True)
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

    def scene_of(self, args: PyTree, y: PyTree) -> PyTree:
        """The scene as the walker has it: as it is unless the coordinates change it."""
        return args

    def switches(self, args: PyTree, y: PyTree) -> tuple[Switch, ...]:
        return self.walker.switches(self.scene_of(args, y), motion_of(y))

    def reset_at_switch(self, args: PyTree, y: PyTree, which: Scalar) -> PyTree:
        after = self.walker.reset_at_switch(self.scene_of(args, y), motion_of(y), which)
        return self.with_motion(y, after)

    def on_held(self, args: PyTree, y: PyTree) -> PyTree:
        return self.with_motion(y, self.walker.on_held(args, motion_of(y)))

    def ending(self, args: PyTree, y: PyTree) -> Scalar:
        return self.walker.ending(self.scene_of(args, y), motion_of(y))

    def arrival(self, section: AbstractSection, args: PyTree, y: PyTree) -> tuple[Scalar, Scalar]:
        if isinstance(section, MotionSection):
            return self.walker.arrival(section.section, self.scene_of(args, y), motion_of(y))
        return super().arrival(section, args, y)

    def load(self, args: PyTree, y: PyTree) -> Scalar | None:
        return None

    def with_motion(self, y: PyTree, motion: PyTree) -> PyTree:
        """A state of the walker with the coordinates of another."""
        return join(y, motion, {name: getattr(y, name) for name in self.coordinates})


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


class DisturbedCycle(AbstractAugmentedSystem):
    """A walker that is pushed for one cycle, or whose swing leg comes down on lower ground.

    `push` is in units of the weight, which leans downhill by it, and with it the vertical that
    parts at joints refer to; `drop` in the walker's height, a leg length. Behind the arrival `drop`
    is zero and its value is `fallen`: the root point is that much higher above the ground. By then
    the leg behind has left the upper ground.

    Attributes:
        walker: the walker, undisturbed.
        coordinates: a clock, and what the disturbance needs.
        disturbance: "push" or "drop".
    """

    disturbance: str = eqx.field(static=True)
    recurring: ClassVar[int] = 1

    def vector_field(self, t: Time, y: PyTree, args: AbstractWalkerScene) -> PyTree:
        rates = self.walker.vector_field(t, motion_of(y), self.scene_of(args, y))
        zero = jnp.zeros_like(y.clock)
        return join(y, rates, dict.fromkeys(self.coordinates, zero) | {"clock": zero + 1.0})

    def reset_map(self, args: AbstractWalkerScene, y: PyTree) -> PyTree:
        after = self.walker.reset_map(args, motion_of(y))
        told = {"clock": y.clock, self.disturbance: jnp.zeros_like(y.clock)}
        if self.disturbance == DROP:
            told["fallen"] = y.drop
            height = args.mechanism.structure.coordinates[1]
            if height in after._fields:
                raised = getattr(after, height) + y.drop * args.mechanism.height
                after = after._replace(**{height: raised})
        return join(y, after, told)

    def scene_of(self, args: AbstractWalkerScene, y: PyTree) -> AbstractWalkerScene:
        """The scene as it is disturbed. Rolling feet meet the step at their section alone."""
        ground: Ground | SteppedGround = args.ground
        if self.disturbance == PUSH:
            ground = dataclasses.replace(args.ground, slope=ground.slope + y.push)
        else:
            depth, leg = y.drop * args.mechanism.height, args.mechanism.structure.swing_leg
            ground = SteppedGround(ground.slope, ground.g, depth, leg)
        return eqx.tree_at(lambda each: each.ground, args, ground)


def disturbed_cycle(walker: AbstractSystem, disturbance: str) -> DisturbedCycle:
    more = (PUSH,) if disturbance == PUSH else ("fallen", DROP)
    return DisturbedCycle(walker, ("clock", *more), disturbance)


class SteppedSection(AbstractSection):
    """Heel strike of a rigid walker, whose foot comes down where the ground now is.

    Attributes:
        section: of the walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        before, unit = exchange_legs(args, motion_of(y)), args.mechanism.height
        # In units of the feet's distance: the height itself is flat where the legs pass.
        apart = jnp.maximum(distance_ahead(args, before), _APART * unit)
        return -2.0 * (clearance(args, before) + y.fallen * unit) / apart

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        return MotionSection(self.section).counts(args, y)


class LowestSwing(AbstractAugmentedSystem):
    """A disturbed walker whose `clearance`, in its heights, is told at its foot's lowest place.

    `passed` is 1 from there to the section, else 0. Clearances of several footsteps add up, as
    their lengths do. A compliant walker's cycle has the footstep in its middle: by the lowest place
    the foot that stands is on the lower ground, and the one that swings has left the upper.

    Attributes:
        walker: the disturbed walker.
    """

    walker: DisturbedCycle
    coordinates: tuple[str, ...] = eqx.field(static=True, default=("clearance", "passed"))

    def vector_field(self, t: Time, y: PyTree, args: AbstractWalkerScene) -> PyTree:
        zero = jnp.zeros_like(y.passed)
        rates = self.walker.vector_field(t, motion_of(y), args)
        return join(y, rates, dict.fromkeys(self.coordinates, zero))

    def reset_map(self, args: AbstractWalkerScene, y: PyTree) -> PyTree:
        motion, zero = motion_of(y), jnp.zeros_like(y.passed)
        drop = y.drop if self.walker.disturbance == DROP else zero
        height = swing_foot(args, motion_of(motion), drop * args.mechanism.height).height
        told = {"clearance": y.clearance + height / args.mechanism.height, "passed": y.passed + 1.0}
        after = self.walker.reset_map(args, motion)
        at_section = join(y, after, {"clearance": y.clearance, "passed": zero})
        return select(y.passed < 0.5, join(y, motion, told), at_section)


class LowestSwingSection(AbstractSection):
    """Behind the arrival `passed` tells which it was: the lowest place, or a walker's own section.

    Attributes:
        section: of the disturbed walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        motion = motion_of(y)
        rises = swing_foot(args, motion_of(motion)).rate
        return jnp.where(y.passed > 0.5, rises, self.section.value(args, motion))

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        motion = motion_of(y)
        swings = swing_foot(args, motion_of(motion)).swings
        return jnp.where(y.passed > 0.5, swings, self.section.counts(args, motion))


class SwingFoot(NamedTuple):
    """Height above its ground [m], its rate, and whether the clearance rule lets it pass."""

    height: Scalar
    rate: Scalar
    swings: Scalar


@functools.singledispatch
def swing_foot(scene: Any, state: PyTree, drop: Scalar | float = 0.0) -> SwingFoot:
    """The foot that swings in the footstep of a cycle, which ends on ground lower by `drop` [m].

    It is the stance leg's, the lower one of several: the cycle has the footstep before, and the
    exchange of legs behind.
    """
    structure, found = scene.mechanism.structure, feet(scene, state)
    lowest, *others = (found[k] for k in structure.feet_of_leg[structure.stance_leg])
    for foot in others:
        lowest = select(foot.penetration > lowest.penetration, foot, lowest)
    swings = jnp.logical_not(jnp.asarray(lowest.admitted))
    return SwingFoot(drop - lowest.penetration, -lowest.penetration_rate, swings)


@swing_foot.register
def _(scene: RigidScene, state: PyTree, drop: Scalar | float = 0.0) -> SwingFoot:
    """That of a walker whose ground is lower at its section alone."""
    return SwingFoot(clearance(scene, state), clearance_rate(scene, state), jnp.asarray(True))

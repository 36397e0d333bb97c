"""A tree of bodies: its pose, points that move with its bodies, and loads on them.

None stands for a number that is zero whatever the state, which costs nothing.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias

import jax.numpy as jnp

from jaxbiped._trigonometry import sine_cosine
from jaxbiped._types import Scalar
from jaxbiped.linalg._sparse_lu import Entry, plus, times
from jaxbiped.scene._bodies import Point
from jaxbiped.scene._structure import Structure, weighted


class Tree(Protocol):
    """A tree of bodies on a root point: a mechanism, or the same bodies on another root."""

    @property
    def structure(self) -> Structure:
        """How the bodies hang together."""

    @property
    def bodies(self) -> tuple[Any, ...]:
        """Each with `mass`, `inertia`, `centre`, and `at`, its hinge on its parent."""


class Arm(NamedTuple):
    """How a point moves with the angle of a body: derivative of its place [m].

    From the body's hinge the point is at (dz, −dx).
    """

    dx: Scalar
    dz: Scalar


Vector: TypeAlias = tuple[Scalar, Scalar]
"""Components x and z in the slope's frame."""


def arm_of(along: Scalar, ahead: Scalar | None, sine: Scalar, cosine: Scalar) -> Arm:
    """The arm of a point (along, ahead) of a body at an angle with this sine and cosine."""
    if ahead is None:
        return Arm(along * cosine, along * sine)
    return Arm(along * cosine - ahead * sine, along * sine + ahead * cosine)


class Motion(NamedTuple):
    """Place and velocity of the root point, and angles and rates of all bodies.

    Attributes:
        x, z: place of the root point in the slope's frame [m]. vx, vz: its velocity [m/s].
        angles, rates: of each body, those that couplings fix included [rad, rad/s].
        clock: time since the last strike [s]; None where no law reads it.
    """

    x: Scalar
    z: Scalar
    vx: Scalar
    vz: Scalar
    angles: tuple[Scalar, ...]
    rates: tuple[Scalar, ...]
    clock: Scalar | None = None


class Pose(NamedTuple):
    """Sines and cosines of a motion, and what follows from them.

    Attributes:
        motion: see `Motion`.
        sines, cosines: of each body's angle.
        hinges: arm of each body's hinge on its parent; None for a body that hangs on the root
            point, or at its parent's own hinge.
    """

    motion: Motion
    sines: tuple[Scalar, ...]
    cosines: tuple[Scalar, ...]
    hinges: tuple[Arm | None, ...]


def pose_of(tree: Tree, motion: Motion) -> Pose:
    """The pose of a tree in a motion."""
    pairs = [sine_cosine(angle) for angle in motion.angles]
    sines, cosines = zip(*pairs, strict=True)
    return rehung(tree, Pose(motion, sines, cosines, ()))


def rehung(tree: Tree, pose: Pose) -> Pose:
    """A pose with the arms of a tree of the same bodies."""
    sines, cosines = pose.sines, pose.cosines
    hinges = [
        None if body.at is None else arm_of(body.at.along, body.at.ahead, sines[p], cosines[p])
        for body, p in zip(tree.bodies, tree.structure.parents, strict=True)
    ]
    return pose._replace(hinges=tuple(hinges))


class PointMotion(NamedTuple):
    """A point of a body, and how it moves.

    Attributes:
        x, z: place [m]. vx, vz: velocity [m/s].
        arms: by the number of each body that carries it, outermost last.
    """

    x: Scalar
    z: Scalar
    vx: Scalar
    vz: Scalar
    arms: tuple[tuple[int, Arm], ...]


def point_motion(structure: Structure, pose: Pose, body: int, point: Point) -> PointMotion:
    """Place and velocity of a point of a body."""
    own = arm_of(point.along, point.ahead, pose.sines[body], pose.cosines[body])
    x, z, vx, vz, *_ = pose.motion
    chain = structure.chains[body]
    arms = []
    for link, after in zip(chain, (*chain[1:], None), strict=True):
        arm = own if after is None else pose.hinges[after]
        if arm is None:
            continue
        rate = pose.motion.rates[link]
        x, z = x + arm.dz, z - arm.dx
        vx, vz = vx + arm.dx * rate, vz + arm.dz * rate
        arms.append((link, arm))
    return PointMotion(x, z, vx, vz, tuple(arms))


def point_acceleration(
    point: PointMotion, rates: Sequence[Scalar], turning: Sequence[Scalar]
) -> Vector:
    """Acceleration of a point of a body relative to the root point [m/s²].

    `rates` and `turning` are rates and accelerations of all bodies' angles.
    """
    x = z = jnp.zeros_like(turning[0])
    for link, arm in point.arms:
        square = rates[link] * rates[link]
        x = x + arm.dx * turning[link] - arm.dz * square
        z = z + arm.dz * turning[link] + arm.dx * square
    return x, z


class Loads(NamedTuple):
    """Generalised forces: on the root point [N], and on each body's angle [N·m]."""

    x: Entry
    z: Entry
    torques: tuple[Entry, ...]

    @staticmethod
    def none(structure: Structure) -> "Loads":
        """No load at all."""
        return Loads(None, None, (None,) * len(structure.bodies))

    def plus(self, other: "Loads") -> "Loads":
        """Both loads together."""
        torques = (plus(*each) for each in zip(self.torques, other.torques, strict=True))
        return Loads(plus(self.x, other.x), plus(self.z, other.z), tuple(torques))

    def entries(self) -> list[Entry]:
        """Of all coordinates: the root point's place, then each body's angle."""
        return [self.x, self.z, *self.torques]

    def with_force(self, point: PointMotion, x: Entry, z: Entry) -> "Loads":
        """With a force (x, z) on a point, which turns every body that carries it."""
        torques = list(self.torques)
        for body, arm in point.arms:
            torques[body] = plus(torques[body], plus(times(x, arm.dx), times(z, arm.dz)))
        return Loads(plus(self.x, x), plus(self.z, z), tuple(torques))

    def with_torques(self, weights: Sequence[tuple[int, float]], torque: Entry) -> "Loads":
        """With a torque on an angle that is a sum of bodies' angles."""
        if torque is None:
            return self
        torques = list(self.torques)
        for body, weight in weights:
            torques[body] = plus(torques[body], weighted(torque, weight))
        return self._replace(torques=tuple(torques))

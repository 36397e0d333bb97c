"""A mechanism on the leg that stands, and its motion."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import jax.numpy as jnp

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._joint_loads import motion_of
from jaxbiped.dynamics._standing_tree import (
    HINGE,
    Sole,
    StandingTree,
    either,
    moved,
    sole_of,
    standing_tree,
)
from jaxbiped.dynamics._tree import Motion, PointMotion, Pose, point_motion, pose_of, rehung
from jaxbiped.dynamics._tree_inertia import mass_entries
from jaxbiped.linalg._sparse_lu import SparseMatrix, product
from jaxbiped.scene._abstract_scene import AbstractWalkerScene
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._modes import Mode
from jaxbiped.scene._rigid_feet import next_leg, rigid_modes, standing_legs
from jaxbiped.scene._structure import Indices, Structure

_T = TypeVar("_T")


class Stance(NamedTuple):
    """A mechanism that stands on a foot, and its motion.

    Attributes:
        mechanism: what stands.
        leg: number of the leg that does.
        tree: of it there.
        pose: of that tree, in a frame in which the foot's centre is over 0 at its body's angle 0.
        mode: what stands, and what is held; None where only one mode can occur.
    """

    mechanism: Mechanism
    leg: int
    tree: StandingTree
    pose: Pose
    mode: Mode | None = None

    @property
    def feet(self) -> Indices:
        """Numbers of the feet of the leg that stands."""
        return self.mechanism.structure.feet_of_leg[self.leg]

    @property
    def next_feet(self) -> Indices:
        """Numbers of the feet of the leg that swings."""
        structure = self.mechanism.structure
        return structure.feet_of_leg[next_leg(structure, self.leg)]

    @property
    def may_hold(self) -> bool:
        """Whether there is anything that may be held beside the sole."""
        return len(self.feet) > 1 or bool(rigid_modes(self.mechanism).limits)

    @property
    def stands(self) -> tuple[Scalar, ...]:
        """Which of two feet stand; none where the leg has one."""
        if self.mode is None or len(self.feet) < 2:
            return ()
        return rigid_modes(self.mechanism).stands_of(self.mode, self.leg)

    @property
    def held(self) -> list[Scalar]:
        """Which rows of `Holds` are held; booleans."""
        assert self.mode is not None
        stands = self.stands
        return [*([stands[0] & stands[1]] if stands else []), *self.mode.held]

    @property
    def root(self) -> PointMotion:
        """Place and velocity of the mechanism's root point."""
        body, place = self.tree.hub
        at: Any = HINGE if place is None else place
        return point_motion(self.tree.structure, self.pose, body, at)

    def point(self, sole: Sole) -> PointMotion:
        """Place and velocity of the centre of a sole's circle."""
        centre: Any = moved(sole.centre, self.tree.origins.get(sole.body))
        return point_motion(self.tree.structure, self.pose, sole.body, centre)

    def foot(self, number: int) -> PointMotion:
        """Place and velocity of the centre of a foot's circle."""
        return self.point(sole_of(self.mechanism, number))

    def mass_matrix(self) -> SparseMatrix:
        """Of the root's place and all angles."""
        return mass_entries(self.tree.structure, self.tree.known, self.pose)

    def height(self, number: int) -> Scalar:
        """Height of the lowest point of a foot above the ground [m]."""
        centre, radius = self.foot(number).z, self.mechanism.feet[number].radius
        return centre if radius is None else centre - radius

    def on(self, sole: Sole, rates: Sequence[Scalar] | None = None) -> "Stance":
        """The same angles on another sole; with other rates of all bodies where they are given."""
        tree = standing_tree(self.mechanism, sole)
        motion = self.pose.motion
        turning = motion.rates if rates is None else tuple(rates)
        rolled = _rolling(tree, motion._replace(rates=turning))
        pose = rehung(tree, self.pose._replace(motion=rolled))
        return Stance(self.mechanism, sole.leg, tree, pose)


def stance_on(scene: AbstractWalkerScene, state: Any, leg: int) -> Stance:
    """A walker in a state, on this leg whichever stands."""
    mechanism, zero = scene.mechanism, jnp.zeros_like(state[0])
    angles, turning = angles_and_rates(mechanism.structure, state)
    modes, feet = rigid_modes(mechanism), mechanism.structure.feet_of_leg[leg]
    mode = modes.decoded(jnp, state.mode) if modes.any else None
    sole = sole_of(mechanism, feet[0])
    if mode is not None and len(feet) > 1:
        first, _ = modes.stands_of(mode, leg)
        sole = either(first, sole, sole_of(mechanism, feet[1]))
    tree = standing_tree(mechanism, sole)
    whole = motion_of(mechanism, scene.ground, [zero, zero, *angles], [zero, zero, *turning])
    return Stance(mechanism, leg, tree, pose_of(tree, _rolling(tree, whole)), mode)


def of_stance(scene: AbstractWalkerScene, state: Any, function: Callable[[Stance], _T]) -> _T:
    """What a function finds of a walker on the leg that stands."""
    *others, last = standing_legs(scene.mechanism.structure)
    found = function(stance_on(scene, state, last))
    for leg in others:
        other = stance_on(scene, state, leg)
        assert other.mode is not None
        stands = rigid_modes(scene.mechanism).stands_on(other.mode, leg)
        found = select(stands, function(other), found)
    return found


def angles_and_rates(
    structure: Structure, state: Any
) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
    """The free angles of a state on rigid feet, and their rates."""
    count = len(structure.free)
    return tuple(state[1 : 1 + count]), tuple(state[1 + count : 1 + 2 * count])


def kinetic_energy(scene: AbstractWalkerScene, state: Any) -> Scalar:
    """Kinetic energy of a rigid walker in a state [J]."""

    def energy(stance: Stance) -> Scalar:
        motion = stance.pose.motion
        rates = dict(enumerate((motion.vx, motion.vz, *motion.rates)))
        momenta: Any = product(stance.mass_matrix(), rates)
        others = (rates[i] * momenta[i] for i in range(1, len(rates)))
        found: Scalar = 0.5 * sum(others, rates[0] * momenta[0])
        return found

    return of_stance(scene, state, energy)


def _rolling(tree: StandingTree, motion: Motion) -> Motion:
    """A motion with place and velocity of the foot's centre as its body turns."""
    zero, radius = jnp.zeros_like(motion.x), tree.radius
    if radius is None:
        return motion._replace(x=zero, z=zero, vx=zero, vz=zero)
    angle, rate = motion.angles[tree.body], motion.rates[tree.body]
    return motion._replace(x=-(radius * angle), z=zero + radius, vx=-(radius * rate), vz=zero)

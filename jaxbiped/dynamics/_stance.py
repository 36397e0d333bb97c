"""A mechanism on the leg that stands: its tree of bodies, hung on the foot's centre, and motion.

The foot rolls without slip, so that its centre moves by −r ω of its body: the place along the slope
follows from angles, which alone are the coordinates.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import jax.numpy as jnp

from jaxbiped._parameter_declaration import with_fields
from jaxbiped._types import Scalar, select
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.dynamics._force_balance import Weights, free_weights
from jaxbiped.dynamics._joint_loads import motion_of
from jaxbiped.dynamics._tree import Motion, PointMotion, Pose, point_motion, pose_of, rehung
from jaxbiped.dynamics._tree_inertia import Composites, composites, mass_entries
from jaxbiped.linalg._sparse_lu import Entry, SparseMatrix, plus
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._modes import Mode, next_leg, rigid_modes, standing_legs
from jaxbiped.scene._scene import AbstractWalkerScene
from jaxbiped.scene._state_types import CLOCK, scalars_named
from jaxbiped.scene._structure import Indices, Structure, weighted


class Place(NamedTuple):
    """A point of a body in its frame, as `Point`."""

    along: Any
    ahead: Any


HINGE = Place(0.0, None)


class Sole(NamedTuple):
    """What stands: a circle of a body, or a point.

    Attributes:
        leg, body: their numbers.
        centre: of the circle, in the body's frame.
        radius: of it [m]; None for a point, about which the body pivots.
    """

    leg: int
    body: int
    centre: Any
    radius: Entry


def sole_of(mechanism: Mechanism, foot: int) -> Sole:
    """A foot, by its number."""
    own, structure = mechanism.feet[foot], mechanism.structure
    return Sole(structure.leg_of_foot[foot], structure.feet[foot], own.centre, own.radius)


def either(first_stands: Scalar, first: Sole, second: Sole) -> Sole:
    """The first of two soles of a body where it stands, else the second."""

    def chosen(a: Entry, b: Entry) -> Entry:
        if a is None and b is None:
            return None
        return jnp.where(first_stands, 0.0 if a is None else a, 0.0 if b is None else b)

    (along, ahead), (other, beyond) = ((s.centre.along, s.centre.ahead) for s in (first, second))
    centre = Place(chosen(along, other), chosen(ahead, beyond))
    return first._replace(centre=centre, radius=chosen(first.radius, second.radius))


class StandingTree(NamedTuple):
    """The bodies of a mechanism, hung on the centre of one foot's circle.

    Attributes:
        structure: how they hang there; their numbers are those in the mechanism.
        bodies: with places in frames whose origins are the hinges of this tree.
        body: that of the foot.
        radius: of the foot [m]; None for a point, about which it pivots.
        hub: the body that the mechanism's root point is on, and where; None for its hinge.
        root_mass: at that point [kg]; None for none.
        origins: of the bodies whose frames have other origins than in the mechanism, these.
    """

    structure: Structure
    bodies: tuple[Any, ...]
    body: int
    radius: Entry
    hub: tuple[int, Place | None]
    root_mass: Entry
    origins: dict[int, Any]

    @property
    def known(self) -> Composites:
        """The composite bodies."""
        return composites(self, points=[(*self.hub, self.root_mass)])

    @property
    def weights(self) -> Weights:
        """Each coordinate by the free angles: the root's rolls, the outermost are the last."""
        structure = self.structure
        own = free_weights(structure)
        order = [2 + structure.free.index(j) for j in structure.outwards if j in structure.free]
        rows = [[(order.index(k), weight) for k, weight in each] for each in own[2:]]
        rolls: Any = []
        if self.radius is not None:
            rolls = [(row, weighted(-self.radius, weight)) for row, weight in rows[self.body]]
        return [rolls, [], *rows]

    @property
    def rows(self) -> list[int]:
        """The row of `weights` that each free body is, in their order."""
        weights = self.weights
        return [weights[2 + j][0][0] for j in self.structure.free]

    def free_values(self, found: Any) -> list[Scalar]:
        """Values by the rows of `weights`, in the order of the free bodies."""
        return [found[row] for row in self.rows]


@bounded_cache(PROGRAMS)
def _rerooted(structure: Structure, body: int) -> Structure:
    """The structure with a body on the root that was its outermost one."""
    parents, chain = list(structure.parents), structure.chains[body]
    for j in structure.children[-1]:
        parents[j] = chain[0]
    for below, above in zip(chain, (*chain[1:], -1), strict=True):
        parents[below] = above
    return dataclasses.replace(structure, parents=tuple(parents))


def standing_tree(mechanism: Mechanism, sole: Sole) -> StandingTree:
    """The tree of a mechanism that stands on a sole."""
    structure = mechanism.structure
    bodies = list(mechanism.bodies)
    body = sole.body
    chain = structure.chains[body]
    hinges = [*(bodies[j].at for j in chain[1:]), sole.centre]
    at: list[Any] = [each.at for each in bodies]
    for j, hinge in zip(chain, hinges, strict=True):
        for k in structure.children[j]:
            at[k] = moved(bodies[k].at, hinge)
    hub = moved(None, hinges[0])
    for k in structure.children[-1]:
        at[k] = hub
    for j, hinge in zip(chain, (*hinges[1:], None), strict=True):
        at[j] = moved(None, hinge)
    at[body] = None
    for j, hinge in zip(chain, hinges, strict=True):
        bodies[j] = with_fields(bodies[j], centre=moved(bodies[j].centre, hinge))
    return StandingTree(
        structure=_rerooted(structure, body),
        bodies=tuple(with_fields(each, at=place) for each, place in zip(bodies, at, strict=True)),
        body=body,
        radius=sole.radius,
        hub=(chain[0], hub),
        root_mass=mechanism.root_mass,
        origins=dict(zip(chain, hinges, strict=True)),
    )


def moved(point: Any, origin: Any) -> Place | None:
    """A point seen from another origin in the same frame; None is the frame's own."""
    if origin is None:
        return point
    if point is None:
        return Place(-origin.along, None if origin.ahead is None else -origin.ahead)
    ahead = point.ahead if origin.ahead is None else plus(point.ahead, -origin.ahead)
    return Place(point.along - origin.along, ahead)


_T = TypeVar("_T")


class Stance(NamedTuple):
    """A mechanism that stands on a foot, and its motion.

    Attributes:
        mechanism: what stands.
        leg: number of the leg that does.
        tree: of it there.
        pose: of that tree, in a frame in which the foot's centre is over 0 at its body's angle 0.
        mode: what stands, and what is held; nothing where only one mode can occur.
    """

    mechanism: Mechanism
    leg: int
    tree: StandingTree
    pose: Pose
    mode: Mode = Mode((), (), ())

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
        if not self.mode.stands or len(self.feet) < 2:
            return ()
        return rigid_modes(self.mechanism).stands_of(self.mode, self.leg)

    @property
    def held(self) -> list[Scalar]:
        """Which rows of `Holds` are held; booleans."""
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
    modal = scalars_named(state, ("mode",)) if modes.any else ()
    mode = modes.decoded(jnp, *modal) if modal else Mode((), (), ())
    sole = sole_of(mechanism, feet[0])
    if mode.stands and len(feet) > 1:
        first, _ = modes.stands_of(mode, leg)
        sole = either(first, sole, sole_of(mechanism, feet[1]))
    tree = standing_tree(mechanism, sole)
    whole = motion_of(mechanism, scene.ground, [zero, zero, *angles], [zero, zero, *turning])
    whole = whole._replace(clock=getattr(state, CLOCK, None))
    return Stance(mechanism, leg, tree, pose_of(tree, _rolling(tree, whole)), mode)


def of_stance(scene: AbstractWalkerScene, state: Any, function: Callable[[Stance], _T]) -> _T:
    """What a function finds of a walker on the leg that stands."""
    *others, last = standing_legs(scene.mechanism.structure)
    found = function(stance_on(scene, state, last))
    for leg in others:
        other = stance_on(scene, state, leg)
        stands = rigid_modes(scene.mechanism).stands_on(other.mode, leg)
        found = select(stands, function(other), found)
    return found


def angles_and_rates(
    structure: Structure, state: Any
) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
    """The free angles of a state on rigid feet, and their rates."""
    angles, rates = structure.coordinates[2:], structure.rates[2:]
    return scalars_named(state, angles), scalars_named(state, rates)


def _rolling(tree: StandingTree, motion: Motion) -> Motion:
    """A motion with place and velocity of the foot's centre as its body turns."""
    zero, radius = jnp.zeros_like(motion.x), tree.radius
    if radius is None:
        return motion._replace(x=zero, z=zero, vx=zero, vz=zero)
    angle, rate = motion.angles[tree.body], motion.rates[tree.body]
    return motion._replace(x=-(radius * angle), z=zero + radius, vx=-(radius * rate), vz=zero)

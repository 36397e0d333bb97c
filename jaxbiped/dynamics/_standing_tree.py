"""Tree of a mechanism's bodies, hung on the centre of the foot that stands.

The foot rolls without slip, so that its centre moves by −r ω of its body: the place along the slope
follows from angles, which alone are the coordinates.
"""

import dataclasses
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._parameter_declaration import with_fields
from jaxbiped._types import Scalar
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.dynamics._implicit_field import Weights, free_weights
from jaxbiped.dynamics._tree_inertia import Composites, composites
from jaxbiped.linalg._sparse_lu import Entry, plus
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._structure import Structure, weighted


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

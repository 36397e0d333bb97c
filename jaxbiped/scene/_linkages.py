"""Mechanisms as linkages."""

from typing import Any

from jaxbiped._checks import ArgumentError, holds_somewhere
from jaxbiped._parameter_declaration import with_fields
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.constraints._linkage import Linkage, LinkAngle, LinkBody, Pin
from jaxbiped.scene._bodies import Body, Point
from jaxbiped.scene._joint_parts import Coupling
from jaxbiped.scene._mechanism import Mechanism, mechanism_of
from jaxbiped.scene._structure import Angle


def loaded_bodies(mechanism: Mechanism) -> tuple[Body, ...]:
    """The bodies of a mechanism, those on the root point with equal shares of its mass.

    All shares move with the root point, so that together they are its mass.
    """
    structure, mass = mechanism.structure, mechanism.root_mass
    if mass is None:
        return mechanism.bodies
    share = 1.0 / len(structure.children[-1])
    return tuple(
        _with_share(body, mass, share) if parent < 0 else body
        for body, parent in zip(mechanism.bodies, structure.parents, strict=True)
    )


def _with_share(body: Body, root_mass: Parameter, share: float) -> Body:
    """A body on the root point with a share of its mass."""

    def add(_: Any, root: Any, mass: Any, inertia: Any, *centre: Any) -> tuple[Any, ...]:
        whole = mass + share * root
        moved = [mass * place / whole for place in centre]
        for before, after in zip(centre, moved, strict=True):
            inertia = inertia + mass * before * (before - after)
        return whole, inertia, *moved

    ahead = () if body.centre.ahead is None else (body.centre.ahead,)
    mass, inertia, *centre = by_numpy(
        add, root_mass, body.mass, body.inertia, body.centre.along, *ahead
    )
    return with_fields(body, mass=mass, inertia=inertia, centre=Point(*centre))


def check_loaded_bodies(mechanism: Mechanism) -> None:
    """Raises `ArgumentError` for a body that cannot move by itself."""
    for body in loaded_bodies(mechanism):
        for name in ("mass", "inertia"):
            value = getattr(body, name)
            if holds_somewhere(by_numpy(lambda _, value: value <= 0.0, value)):
                raise ArgumentError(
                    f"Body({body.name!r}) has no {name}, which is not allowed in redundant "
                    "coordinates, in which every body moves by itself: give it some, or simulate "
                    "the scene in minimal coordinates."
                )


def walker_linkage(walker: Any, orientation: str = "angle", slope: Parameter = 0.0) -> Linkage:
    """The linkage of a walker: its bodies, pinned to each other at their hinges.

    The mass of the root point is shared equally between the bodies that hang on it, and the first
    of these is pinned to the others there: Φ = hinge of the first − hinge of the other. A pin joins
    every other body to its parent: Φ = hinge on the parent − hinge of the body. Pins are in the
    order of the bodies, without the first one, and couplings follow.

    Args:
        walker: a `Mechanism`, or a module that makes one.
        orientation: one of `ORIENTATIONS`.
        slope: angle of the vertical from the slope's normal [rad], for couplings to the vertical.

    Returns:
        All bodies and joints, SI units.

    Raises:
        ArgumentError: the orientation is unknown, or a body has no mass or inertia.
    """
    mechanism = mechanism_of(walker)
    structure, bodies = mechanism.structure, loaded_bodies(mechanism)
    pins = tuple(
        Pin(_from_centre(bodies[on], body.at), _from_centre(body, None), on, j)
        for j, (body, parent) in enumerate(zip(bodies, structure.parents, strict=True))
        if j != (on := max(parent, 0))
    )
    couplings = tuple(
        LinkAngle(_held_at(part, angle, slope), angle.weights)
        for angle, part in zip(structure.joints, mechanism.joints, strict=True)
        if isinstance(part, Coupling)
    )
    links = tuple(LinkBody(body.mass, body.inertia) for body in bodies)
    return Linkage(links, pins, orientation, couplings)


def _from_centre(body: Body, place: Point | None) -> tuple[Scalar, Scalar]:
    """A point of a body, its hinge for None, from its mass centre: (x, z) where it hangs down."""

    def of(_: Any, *given: Any) -> tuple[Any, Any]:
        along, ahead, own_along, own_ahead = given
        return ahead - own_ahead, own_along - along

    point = Point(0.0) if place is None else place
    values = (point.along, point.ahead, body.centre.along, body.centre.ahead)
    return by_numpy(of, *(0.0 if each is None else each for each in values))


def _held_at(coupling: Coupling, angle: Angle, slope: Parameter) -> Scalar:
    """The sum of bodies' angles that a coupling holds [rad]."""
    rest = 0.0 if coupling.rest is None else coupling.rest
    return by_numpy(lambda _, rest, slope: rest - angle.vertical * slope, rest, slope)

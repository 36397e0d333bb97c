"""Linkages as scenes: one in gravity, and the walker as two legs and one pin."""

from typing import Any

import equinox as eqx

from jaxbiped._checks import check_type
from jaxbiped._parameter_declaration import check_parameters, parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod
from jaxbiped.constraints._linkage import Body, Joint, Linkage
from jaxbiped.scene._walker import Walker


class LinkageScene(eqx.Module):
    """A linkage in gravity, and how its joints are held.

    Attributes:
        linkage: bodies and joints.
        method: how the constraints are held.
        gravity: acceleration (x, z) [m/s²].

    Raises:
        ArgumentError: a part of the wrong type, or gravity that is not finite.
    """

    linkage: Linkage
    method: AbstractConstraintMethod
    gravity: tuple[Parameter, Parameter] = parameter(
        "gravity", "$g$", "m/s^2", several=True, default=(0.0, -9.8)
    )

    def __check_init__(self) -> None:
        check_type("linkage", self.linkage, Linkage)
        check_type("method", self.method, AbstractConstraintMethod)
        check_parameters(self)


def leg_of(walker: Walker) -> tuple[Body, Scalar]:
    """One leg with half of the hip's mass, and the distance of its centre of mass from the hip [m].

    Both halves move with the hip, so that together they are the walker's hip mass.
    """

    def of(_: Any, m: Any, d: Any, J: Any, hip_mass: Any) -> tuple[Any, Any, Any]:
        mass = m + 0.5 * hip_mass
        distance = m * d / mass
        return mass, J + m * d * (d - distance), distance

    mass, inertia, distance = by_numpy(of, walker.m, walker.d, walker.J, walker.hip_mass)
    return Body(mass, inertia), distance


def walker_linkage(walker: Walker, orientation: str = "angle") -> Linkage:
    """The walker's two legs, pinned to each other at the hip.

    The first joint's constraint is Φ = hip of leg 1 − hip of leg 2.

    Args:
        walker: masses and lengths.
        orientation: one of `ORIENTATIONS`.

    Returns:
        Two bodies and one joint, SI units.

    Raises:
        ArgumentError: an unknown orientation.
    """
    leg, distance = leg_of(walker)
    hip = (by_numpy(lambda numpy, distance: numpy.zeros_like(distance), distance), distance)
    return Linkage((leg, leg), (Joint(hip, hip, 0, 1),), orientation)

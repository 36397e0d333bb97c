"""The walker as a linkage: two legs and one pin."""

from typing import Any

from jaxbiped._types import Scalar, by_numpy
from jaxbiped.constraints._linkage import Body, Joint, Linkage
from jaxbiped.scene._walker import Walker


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

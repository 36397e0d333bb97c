"""The walker as a linkage: two legs and one pin."""

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.constraints._linkage import Body, Joint, Linkage
from jaxbiped.scene._walker import Walker


def leg_of(walker: Walker) -> tuple[Body, Scalar]:
    """One leg with half of the hip's mass, and the distance of its centre of mass from the hip [m].

    Both halves move with the hip, so that together they are the walker's hip mass.
    """
    mass = walker.m + 0.5 * walker.hip_mass
    distance = walker.m * walker.d / mass
    inertia = walker.J + walker.m * walker.d * (walker.d - distance)
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
    hip = (jnp.zeros_like(distance), distance)
    return Linkage((leg, leg), (Joint(hip, hip, 0, 1),), orientation)

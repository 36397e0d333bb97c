"""Linkages: rigid bodies in a plane, and the pins and held angles that join them."""

import equinox as eqx

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped._parameter_declaration import AbstractPart, check_parameters, parameter
from jaxbiped._types import Parameter

ORIENTATIONS = ("angle", "euler")
"""How a body's orientation is written.

- angle: θ [rad].
- euler: the planar Euler parameters (cos θ/2, sin θ/2), whose normalisation is a constraint more.
"""


class LinkBody(AbstractPart):
    """A rigid body in the plane.

    Attributes:
        mass: mass [kg].
        inertia: moment of inertia about its centre of mass [kg·m²].

    Raises:
        ArgumentError: the mass or the inertia is not above 0.
    """

    mass: Parameter = parameter("body mass", "$m$", "kg", positive=True)
    inertia: Parameter = parameter("body inertia", "$J$", "kg m^2", positive=True)


class Pin(eqx.Module):
    """A frictionless pin, which joins a point of one body to a point of another.

    A body's own frame has its origin at the centre of mass; at θ = 0 its axes are parallel to those
    of the plane.

    Attributes:
        point_1: the pin in the first body's own frame, (x, z) [m].
        point_2: the pin in the second body's own frame, or in the plane if that is the ground [m].
        body_1: position of the first body in the linkage.
        body_2: position of the second body, None for the ground.

    Raises:
        ArgumentError: a coordinate is not finite, or a body is joined to itself.
    """

    point_1: tuple[Parameter, Parameter] = parameter("pin in body 1", "$s_1$", "m", several=True)
    point_2: tuple[Parameter, Parameter] = parameter("pin in body 2", "$s_2$", "m", several=True)
    # mypy takes a call of `parameter` for a default.
    body_1: int = eqx.field(static=True)  # type: ignore[misc]
    body_2: int | None = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        check_parameters(self)
        if self.body_1 == self.body_2:
            raise ArgumentError(
                f"body_2 = {self.body_2} is not allowed: a joint needs two bodies, or the ground."
            )


class LinkAngle(AbstractPart):
    """A sum of bodies' angles that is held, Σ w θ = value.

    With Euler parameters, an angle is known only between −2π and 2π.

    Attributes:
        value: value of the sum [rad].
        weights: of the angles, by the positions of their bodies in the linkage.

    Raises:
        ArgumentError: a value that is not finite.
    """

    value: Parameter = parameter("held angle", r"$\varphi$", "rad")
    # mypy takes a call of `parameter` for a default.
    weights: tuple[tuple[int, float], ...] = eqx.field(static=True, converter=tuple)  # type: ignore[misc]


class Linkage(eqx.Module):
    """Bodies and joints; its coordinates are each body's centre of mass and orientation.

    Attributes:
        bodies: the n bodies.
        joints: the pins; each removes two degrees of freedom, unless other joints already do.
        orientation: one of `ORIENTATIONS`.
        angles: held sums of angles; each removes one degree of freedom.

    Raises:
        ArgumentError: there is no body, a part has the wrong type, a joint names a body that does
            not exist, or the orientation is unknown.
    """

    bodies: tuple[LinkBody, ...] = eqx.field(converter=tuple)
    joints: tuple[Pin, ...] = eqx.field(converter=tuple)
    orientation: str = eqx.field(static=True, default="angle")
    angles: tuple[LinkAngle, ...] = eqx.field(converter=tuple, default=())

    def __check_init__(self) -> None:
        check_choice("orientation", self.orientation, ORIENTATIONS)
        if not self.bodies:
            raise ArgumentError("bodies = () is not allowed: a linkage needs at least one body.")
        for body in self.bodies:
            check_type("bodies", body, LinkBody)
        for joint in self.joints:
            check_type("joints", joint, Pin)
            for number in (joint.body_1, joint.body_2):
                if number is not None:
                    check_choice("body of a joint", number, range(len(self.bodies)))
        for held in self.angles:
            check_type("angles", held, LinkAngle)
            for number, _ in held.weights:
                check_choice("body of a held angle", number, range(len(self.bodies)))

    @property
    def coordinates(self) -> int:
        """Coordinates of one body: 3, or 4 with Euler parameters."""
        return 4 if self.orientation == "euler" else 3

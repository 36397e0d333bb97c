"""Linkages: rigid bodies in a plane, the pins and held angles that join them, and constraints."""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped._parameter_declaration import AbstractPart, check_parameters, parameter
from jaxbiped._trigonometry import angle_of_vector, sine_cosine
from jaxbiped._types import Parameter, Scalar

Row: TypeAlias = dict[int, Scalar]
"""A row of a Jacobian: its entries by coordinate, those left out that are always zero."""

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

    bodies: Sequence[LinkBody] = eqx.field(converter=tuple)
    joints: Sequence[Pin] = eqx.field(converter=tuple)
    orientation: str = eqx.field(static=True, default="angle")
    angles: Sequence[LinkAngle] = eqx.field(converter=tuple, default=())

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

    @property
    def longest_arm(self) -> float:
        """Longest way from a centre of mass to a joint [m], its numbers known; 0 without joints."""
        pins = [joint.point_1 for joint in self.joints]
        pins += [joint.point_2 for joint in self.joints if joint.body_2 is not None]
        return max((float(np.hypot(*pin)) for pin in pins), default=0.0)


class Constraints(NamedTuple):
    """k constraints at one state of a linkage with n coordinates; fields as in `Constrained`.

    Two of each joint, in metres: point of body 1 − point of body 2, along x and along z. Then one
    of each held angle, in radians. With Euler parameters then one of each body, without unit:
    cos² + sin² − 1.
    """

    violation: list[Scalar]
    rate: list[Scalar]
    rows: list[Row]
    bias: list[Scalar]


class Point(NamedTuple):
    """A point of a body, with derivatives with respect to the coordinates and ∂²/∂t² at q̈ = 0.

    Attributes:
        x, z: place in the plane [m].
        row_x, row_z: derivatives with respect to the linkage's coordinates.
        convective_x, convective_z: its acceleration at constant rates of the coordinates [m/s²].
    """

    x: Scalar
    z: Scalar
    row_x: Row
    row_z: Row
    convective_x: Scalar
    convective_z: Scalar


class Heading(NamedTuple):
    """Sine and cosine of a body's orientation, their derivatives and ∂²/∂t² at q̈ = 0."""

    sine: Scalar
    cosine: Scalar
    sine_row: Row
    cosine_row: Row
    sine_convective: Scalar
    cosine_convective: Scalar

    def point(self, q: Sequence[Scalar], first: int, place: tuple[Scalar, Scalar]) -> Point:
        """A point of the body, given in its own frame [m]; `first` is its first coordinate."""
        x, z = place
        sine, cosine, one = self.sine_row, self.cosine_row, jnp.ones_like(q[first])
        return Point(
            x=q[first] + self.cosine * x - self.sine * z,
            z=q[first + 1] + self.sine * x + self.cosine * z,
            row_x={first: one} | {c: cosine[c] * x - sine[c] * z for c in sine},
            row_z={first + 1: one} | {c: sine[c] * x + cosine[c] * z for c in sine},
            convective_x=self.cosine_convective * x - self.sine_convective * z,
            convective_z=self.sine_convective * x + self.cosine_convective * z,
        )


class Turn(NamedTuple):
    """A body's angle [rad], its derivatives, and its acceleration at constant rates of these."""

    angle: Scalar
    row: Row
    convective: Scalar


def turn_of(linkage: Linkage, q: Sequence[Scalar], v: Sequence[Scalar], body: int) -> Turn:
    """The angle of a body."""
    first = linkage.coordinates * body + 2
    if linkage.orientation == "angle":
        return Turn(q[first], {first: jnp.ones_like(q[first])}, jnp.zeros_like(q[first]))
    c, s, c_rate, s_rate = q[first], q[first + 1], v[first], v[first + 1]
    double = 2.0 / (c * c + s * s)
    rate = double * (c * s_rate - s * c_rate)
    row = {first: -double * s, first + 1: double * c}
    return Turn(2.0 * angle_of_vector(s, c), row, -double * rate * (c * c_rate + s * s_rate))


def _headings(
    linkage: Linkage,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
    circular: Sequence[tuple[Scalar, Scalar]] | None,
) -> list[Heading]:
    found = []
    for body in range(len(linkage.bodies)):
        first = linkage.coordinates * body + 2
        if linkage.orientation == "euler":
            (c, s), (c_rate, s_rate) = q[first : first + 2], v[first : first + 2]
            heading = Heading(
                sine=2.0 * c * s,
                cosine=c * c - s * s,
                sine_row={first: 2.0 * s, first + 1: 2.0 * c},
                cosine_row={first: 2.0 * c, first + 1: -2.0 * s},
                sine_convective=4.0 * c_rate * s_rate,
                cosine_convective=2.0 * (c_rate * c_rate - s_rate * s_rate),
            )
        else:
            s, c = sine_cosine(q[first]) if circular is None else circular[body]
            square = v[first] * v[first]
            heading = Heading(s, c, {first: c}, {first: -s}, -s * square, -c * square)
        found.append(heading)
    return found


def constraints_of(
    linkage: Linkage,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
    circular: Sequence[tuple[Scalar, Scalar]] | None = None,
) -> Constraints:
    """Φ, Φ̇, J and γ at coordinates and rates, one scalar each, in the linkage's order.

    `circular` are sines and cosines of the bodies' angles, where known already.
    """
    headings = _headings(linkage, q, v, circular)
    violation: list[Scalar] = []
    rows: list[Row] = []
    bias: list[Scalar] = []
    still = jnp.zeros_like(q[0])
    for joint in linkage.joints:
        body, size = joint.body_1, linkage.coordinates
        one = headings[body].point(q, size * body, joint.point_1)
        if joint.body_2 is None:
            other = Point(*joint.point_2, {}, {}, still, still)
        else:
            other = headings[joint.body_2].point(q, size * joint.body_2, joint.point_2)
        violation += [one.x - other.x, one.z - other.z]
        for own, opposite in ((one.row_x, other.row_x), (one.row_z, other.row_z)):
            rows.append(own | {c: -entry for c, entry in opposite.items()})
        bias += [other.convective_x - one.convective_x, other.convective_z - one.convective_z]
    for held in linkage.angles:
        sum_of = [(turn_of(linkage, q, v, body), weight) for body, weight in held.weights]
        violation.append(sum((turn.angle * weight for turn, weight in sum_of), -held.value))
        rows.append({c: e * weight for turn, weight in sum_of for c, e in turn.row.items()})
        bias.append(sum((-weight * turn.convective for turn, weight in sum_of), still))
    if linkage.orientation == "euler":
        for body in range(len(linkage.bodies)):
            c, s = 4 * body + 2, 4 * body + 3
            violation.append(q[c] * q[c] + q[s] * q[s] - 1.0)
            rows.append({c: 2.0 * q[c], s: 2.0 * q[s]})
            bias.append(-2.0 * (v[c] * v[c] + v[s] * v[s]))
    return Constraints(violation, [row_times(row, v) for row in rows], rows, bias)


def row_times(row: Row, v: Sequence[Scalar]) -> Scalar:
    """A row of J times a vector."""
    terms = [entry * v[c] for c, entry in row.items()]
    return sum(terms[1:], terms[0])


def masses_of(linkage: Linkage) -> list[Scalar]:
    """The diagonal of M [kg, kg·m²], n entries.

    With Euler parameters e the rotation's energy is 2 J |ė|²: the same as ½ J ω² wherever e stays
    normalised, and its mass matrix is constant, diagonal and regular.
    """
    masses: list[Scalar] = []
    for body in linkage.bodies:
        turning = [body.inertia] if linkage.orientation == "angle" else [4.0 * body.inertia] * 2
        masses += [body.mass, body.mass, *turning]
    return masses


def torque_on(linkage: Linkage, q: Sequence[Scalar], torque: Scalar) -> list[Scalar]:
    """Generalised forces of a torque [N·m] on a body with these own coordinates (x, z, …)."""
    if linkage.orientation == "angle":
        return [torque]
    return [-2.0 * torque * q[3], 2.0 * torque * q[2]]

"""Constraints of a linkage and their derivatives, exact; its masses and its bodies' headings."""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._trigonometry import angle_of_vector, sine_cosine
from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_method import Row
from jaxbiped.constraints._linkage import Linkage


class Constraints(NamedTuple):
    """k constraints at one state of a linkage with n coordinates.

    Two of each joint, in metres: point of body 1 − point of body 2, along x and along z. Then one
    of each held angle, in radians. With Euler parameters then one of each body, without unit:
    cos² + sin² − 1.

    Attributes:
        violation: Φ, k entries.
        rate: Φ̇ = J q̇, k entries.
        rows: of J = ∂Φ/∂q, k of them: entries by coordinate, the others are zero.
        bias: γ = −J̇ q̇, k entries.
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


def point_of(
    linkage: Linkage,
    q: Sequence[Scalar],
    headings: Sequence[Heading],
    body: int,
    point: tuple[Scalar, Scalar],
) -> Point:
    """A point of a body, given in the body's own frame [m]."""
    first, heading = linkage.coordinates * body, headings[body]
    x, z = point
    return Point(
        x=q[first] + heading.cosine * x - heading.sine * z,
        z=q[first + 1] + heading.sine * x + heading.cosine * z,
        row_x={first: jnp.ones_like(q[first])}
        | {c: heading.cosine_row[c] * x - heading.sine_row[c] * z for c in heading.sine_row},
        row_z={first + 1: jnp.ones_like(q[first])}
        | {c: heading.sine_row[c] * x + heading.cosine_row[c] * z for c in heading.sine_row},
        convective_x=heading.cosine_convective * x - heading.sine_convective * z,
        convective_z=heading.sine_convective * x + heading.cosine_convective * z,
    )


def headings_of(
    linkage: Linkage,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
    circular: Sequence[tuple[Scalar, Scalar]] | None = None,
) -> list[Heading]:
    """Every body's heading; `circular` are sines and cosines of the angles, where known already."""
    found = []
    for body in range(len(linkage.bodies)):
        first = linkage.coordinates * body + 2
        own = slice(first, first + linkage.coordinates - 2)
        if linkage.orientation == "euler":
            found.append(_by_euler(first, q[own], v[own]))
        else:
            pair = sine_cosine(q[first]) if circular is None else circular[body]
            found.append(_by_angle(first, pair, v[first]))
    return found


def constraints_of(
    linkage: Linkage,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
    headings: Sequence[Heading] | None = None,
) -> Constraints:
    """Φ, Φ̇, J and γ at coordinates and rates, one scalar each, in the linkage's order."""
    headings = headings_of(linkage, q, v) if headings is None else headings
    violation: list[Scalar] = []
    rows: list[Row] = []
    bias: list[Scalar] = []
    for joint in linkage.joints:
        one = point_of(linkage, q, headings, joint.body_1, joint.point_1)
        if joint.body_2 is None:
            x, z = joint.point_2
            violation += [one.x - x, one.z - z]
            rows += [one.row_x, one.row_z]
            bias += [-one.convective_x, -one.convective_z]
            continue
        other = point_of(linkage, q, headings, joint.body_2, joint.point_2)
        violation += [one.x - other.x, one.z - other.z]
        rows += [one.row_x | _subtract(other.row_x), one.row_z | _subtract(other.row_z)]
        bias += [other.convective_x - one.convective_x, other.convective_z - one.convective_z]
    for held in linkage.angles:
        sum_of = [(turn_of(linkage, q, v, body), weight) for body, weight in held.weights]
        violation.append(sum((turn.angle * weight for turn, weight in sum_of), -held.value))
        rows.append({c: e * weight for turn, weight in sum_of for c, e in turn.row.items()})
        still = jnp.zeros_like(q[0])
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


def _by_angle(first: int, circular: tuple[Scalar, Scalar], rate: Scalar) -> Heading:
    (sine, cosine), square = circular, rate * rate
    return Heading(sine, cosine, {first: cosine}, {first: -sine}, -sine * square, -cosine * square)


def _by_euler(first: int, own: Sequence[Scalar], rates: Sequence[Scalar]) -> Heading:
    (c, s), (c_rate, s_rate) = own, rates
    return Heading(
        sine=2.0 * c * s,
        cosine=c * c - s * s,
        sine_row={first: 2.0 * s, first + 1: 2.0 * c},
        cosine_row={first: 2.0 * c, first + 1: -2.0 * s},
        sine_convective=4.0 * c_rate * s_rate,
        cosine_convective=2.0 * (c_rate * c_rate - s_rate * s_rate),
    )


def _subtract(row: Row) -> Row:
    return {c: -entry for c, entry in row.items()}

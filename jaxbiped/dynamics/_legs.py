"""Legs: sets of feet, with the line from the root point to the mean of their centres."""

from collections.abc import Sequence
from typing import NamedTuple

from jaxbiped._trigonometry import angle_of_vector
from jaxbiped._types import Scalar
from jaxbiped.dynamics._tree import PointMotion, Pose
from jaxbiped.scene._bodies import Point
from jaxbiped.scene._structure import Structure


class LegMotion(NamedTuple):
    """The line from the root point to the mean of the feet of a leg.

    Attributes:
        x, z: from the root point to the mean of the feet's centres [m].
        rate: of its angle [rad/s].
        fixed_angle: its angle where it is fixed in a body [rad]; None for another line, and in a
            body that goes round.
    """

    x: Scalar
    z: Scalar
    rate: Scalar
    fixed_angle: Scalar | None

    @property
    def angle(self) -> Scalar:
        """Angle from the slope's normal [rad]."""
        return angle_of_vector(self.x, -self.z) if self.fixed_angle is None else self.fixed_angle


def mean(values: Sequence[Scalar]) -> Scalar:
    """The mean of one number or several."""
    return values[0] if len(values) == 1 else sum(values[1:], values[0]) / len(values)


def leg_motions(
    structure: Structure,
    poses: Sequence[Pose],
    centres: Sequence[Point],
    points: Sequence[PointMotion],
) -> tuple[LegMotion, ...]:
    """The lines of all legs, from where their feet's centres are and how they move.

    Where all feet of a leg are on one body that hangs on the root point, its line is fixed in the
    body, so that its rate is the body's, exactly.
    """
    return tuple(_line(structure, leg, poses, centres, points) for leg in structure.feet_of_leg)


def _line(
    structure: Structure,
    leg: tuple[int, ...],
    poses: Sequence[Pose],
    centres: Sequence[Point],
    points: Sequence[PointMotion],
) -> LegMotion:
    bodies = {structure.feet[k] for k in leg}
    first = structure.feet[leg[0]]
    motion = poses[first].motion
    x = mean([points[k].x for k in leg]) - motion.x
    z = mean([points[k].z for k in leg]) - motion.z
    if len(bodies) == 1 and structure.parents[first] < 0:
        angle, ahead = motion.angles[first], [c for k in leg if (c := centres[k].ahead) is not None]
        if ahead:
            along = mean([centres[k].along for k in leg])
            angle = angle + angle_of_vector(sum(ahead[1:], ahead[0]) / len(leg), along)
        goes_round = structure.turn is not None  # its angle is known but for whole turns
        return LegMotion(x, z, motion.rates[first], None if goes_round else angle)
    vx = mean([points[k].vx for k in leg]) - motion.vx
    vz = mean([points[k].vz for k in leg]) - motion.vz
    return LegMotion(x, z, (x * vz - z * vx) / (x * x + z * z), None)

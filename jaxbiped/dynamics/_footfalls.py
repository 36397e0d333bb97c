"""Feet, legs and footfalls: how they move, which legs touch, and which of them come down ahead."""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._trigonometry import angle_of_vector
from jaxbiped._types import Scalar, any_of
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._tree import PointMotion, Pose
from jaxbiped.scene._structure import Structure


class FootMotion(NamedTuple):
    """Kinematics of one foot, leaves shaped as the state's.

    Attributes:
        x, z: centre of the foot in the slope's frame [m].
        vx, vz: velocity of that centre [m/s].
        penetration: δ = r − z, positive when indented, plus the foot's extension if it has a
            preload [m].
        penetration_rate: δ̇ = −vz, plus the rate of the extension [m/s].
        slip_speed: V_T = vx + r θ̇, tangential velocity of the material point in contact [m/s].
        admitted: whether the clearance rule lets the foot touch (boolean), None for "always",
            Python's False for "never".
        bristle: see `AbstractBristleLaw` [–]; None if friction has no memory.
    """

    x: Scalar
    z: Scalar
    vx: Scalar
    vz: Scalar
    penetration: Scalar
    penetration_rate: Scalar
    slip_speed: Scalar
    admitted: Scalar | bool | None
    bristle: Scalar | None


@kept_alone
def touches(foot: FootMotion) -> Scalar:
    """Whether the foot is in contact (boolean): indented and admitted by the clearance rule.

    Args:
        foot: kinematics of one foot, see `feet`.

    Returns:
        Booleans shaped as the state's leaves.
    """
    below = foot.penetration > 0.0
    return below if foot.admitted is None else below & foot.admitted


def touching_legs(structure: Structure, feet: Sequence[FootMotion]) -> tuple[Scalar, ...]:
    """Whether each leg touches (boolean): any of its feet does."""
    return tuple(any_of([touches(feet[k]) for k in leg]) for leg in structure.feet_of_leg)


def leg_places(structure: Structure, feet: Sequence[FootMotion]) -> tuple[Scalar, ...]:
    """Where each leg stands along the slope: the mean of its feet [m]."""
    return tuple(mean([feet[k].x for k in leg]) for leg in structure.feet_of_leg)


@kept_alone
def landings(
    structure: Structure, before: Sequence[FootMotion], after: Sequence[FootMotion]
) -> tuple[Scalar, ...]:
    """Whether each leg comes to touch between two moments, ahead of who carries (booleans).

    Such a landing is a footstep where another leg made the one before. Of two other legs or more
    the one with the deepest foot carries; of a single leg every landing counts.
    """
    touched, touching = (touching_legs(structure, feet) for feet in (before, after))
    places = leg_places(structure, after)
    found = []
    for i, (was, now) in enumerate(zip(touched, touching, strict=True)):
        lands = ~was & now
        carrier = carrier_place(structure, after, places, i)
        found.append(lands if carrier is None else lands & (places[i] > carrier))
    return tuple(found)


def carrier_place(
    structure: Structure, feet: Sequence[FootMotion], places: Sequence[Scalar], leg: int
) -> Scalar | None:
    """Place of the other leg that carries, the deepest that may touch; None for a single leg."""
    others = [i for i in range(len(structure.legs)) if i != leg]
    if not others:
        return None
    place = places[others[0]]
    if len(others) == 1:
        return place
    deepest = leg_depth(structure, feet, others[0], admitted=True)
    for i in others[1:]:
        depth = leg_depth(structure, feet, i, admitted=True)
        place = jnp.where(depth > deepest, places[i], place)
        deepest = jnp.maximum(depth, deepest)
    return place


def leg_depth(
    structure: Structure, feet: Sequence[FootMotion], leg: int, *, admitted: bool = False
) -> Scalar:
    """How deep the deepest foot of a leg is [m]; of those that may touch, if only `admitted`."""
    depths = []
    for foot in (feet[k] for k in structure.feet_of_leg[leg]):
        depth = foot.penetration
        if admitted and foot.admitted is not None:
            depth = jnp.where(foot.admitted, depth, -jnp.inf)
        depths.append(depth)
    return functools.reduce(jnp.maximum, depths)


@kept_alone
def standing_leg(structure: Structure, feet: Sequence[FootMotion]) -> Scalar:
    """Number of the leg that alone touches, from 1 on; 0 where none or several do."""
    touching = touching_legs(structure, feet)
    found = jnp.zeros_like(touching[0], dtype=int)
    for i in reversed(range(len(touching))):
        others = [each for k, each in enumerate(touching) if k != i]
        alone = touching[i] & ~any_of(others) if others else touching[i]
        found = jnp.where(alone, i + 1, found)
    return found


class LegMotion(NamedTuple):
    """The line from the root point to the mean of the feet of a leg.

    Attributes:
        x, z: from the root point to the mean of the feet's centres [m].
        rate: of its angle [rad/s].
    """

    x: Scalar
    z: Scalar
    rate: Scalar

    @property
    def angle(self) -> Scalar:
        """Angle from the slope's normal, between −π and π [rad]."""
        return angle_of_vector(self.x, -self.z)


def mean(values: Sequence[Scalar]) -> Scalar:
    """The mean of one number or several."""
    return values[0] if len(values) == 1 else sum(values[1:], values[0]) / len(values)


def leg_motions(
    structure: Structure, poses: Sequence[Pose], points: Sequence[PointMotion]
) -> tuple[LegMotion, ...]:
    """The lines of all legs, from where their feet's centres are and how they move.

    Where all feet of a leg are on one body that hangs on the root point, its line is fixed in the
    body, so that its rate is the body's, exactly.
    """
    found = []
    for leg in structure.feet_of_leg:
        bodies, first = {structure.feet[k] for k in leg}, structure.feet[leg[0]]
        motion = poses[first].motion
        x = mean([points[k].x for k in leg]) - motion.x
        z = mean([points[k].z for k in leg]) - motion.z
        if len(bodies) == 1 and structure.parents[first] < 0:
            found.append(LegMotion(x, z, motion.rates[first]))
            continue
        vx = mean([points[k].vx for k in leg]) - motion.vx
        vz = mean([points[k].vz for k in leg]) - motion.vz
        found.append(LegMotion(x, z, (x * vz - z * vx) / (x * x + z * z)))
    return tuple(found)

"""Surfaces of a rigid walker's states: where single support ends, by a heel strike or a fall.

Where all legs are bodies on the root point, their angles tell both, exactly; else places do, in
units of the walker's height.
"""

import functools
import math
from typing import Any

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, by_numpy
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._contacts import legs_at
from jaxbiped.dynamics._footfalls import mean
from jaxbiped.dynamics._stance import Stance, of_stance
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._modes import next_leg, standing_legs
from jaxbiped.scene._scene import AbstractWalkerScene, RigidScene, is_rigid

FALL_ANGLE = 1.0
"""A root point lower than a straight leg at this angle [rad] could carry it has fallen."""

_APART = 1e-3
"""How far ahead a foot strikes at least, in units of the walker's height: where two legs of one
length pass each other their feet are level as well, and none comes down."""


def rate_unit(scene: AbstractWalkerScene) -> Scalar:
    """√(g/l), by the root point's height l with all angles 0 [1/s]."""
    return by_numpy(
        lambda numpy, g, length: numpy.sqrt(g / length), scene.ground.g, scene.mechanism.height
    )


def clearance(scene: RigidScene, state: Any) -> Scalar:
    """Height of the swing foot above the ground [m]; of a leg's lowest foot."""
    return of_stance(scene, state, _clearance)


def _clearance(stance: Stance) -> Scalar:
    swings, stands = (
        functools.reduce(jnp.minimum, [stance.height(k) for k in feet])
        for feet in (stance.next_feet, stance.feet)
    )
    # Whichever foot of its leg stands, the lowest one is on the ground.
    return swings if len(stance.feet) == 1 else swings - stands


def clearance_rate(scene: RigidScene, state: Any) -> Scalar:
    """Its rate [m/s], of the swing leg's feet on average."""

    def rate(stance: Stance) -> Scalar:
        return mean([stance.foot(k).vz for k in stance.next_feet])

    return of_stance(scene, state, rate)


def distance_ahead(scene: RigidScene, state: Any) -> Scalar:
    """How far the swing leg's feet are ahead of the standing one's, on average [m]."""
    return of_stance(scene, state, _distance_ahead)


def _distance_ahead(stance: Stance) -> Scalar:
    return mean([stance.foot(k).x for k in stance.next_feet]) - standing_place(stance)


def standing_place(stance: Stance) -> Scalar:
    """Where the centre of the standing foot is, or those of a leg's feet on average [m]."""
    if len(stance.feet) == 1:
        return stance.pose.motion.x
    return mean([stance.foot(k).x for k in stance.feet])


def straight_legs(mechanism: Mechanism) -> tuple[int, int] | None:
    """Numbers of swing leg and stance leg where these are alike bodies on the root point.

    Such a walker that has fallen leans to one side for good; with bent legs it may change.
    """
    structure, leg = mechanism.structure, mechanism.structure.stance_leg
    if len(standing_legs(structure)) > 1:
        return None
    feet = (*structure.feet_of_leg[next_leg(structure, leg)], *structure.feet_of_leg[leg])
    bodies = [structure.feet[k] for k in feet]
    bent = any(structure.parents[j] >= 0 for j in bodies) or len(feet) > 2
    if bent or any(mechanism.feet[k].centre.ahead is not None for k in feet):
        return None
    swings, stands = bodies
    return swings, stands


def _leg_angles(stance: Stance) -> tuple[Scalar, Scalar] | None:
    """Angles of the two, where there are."""
    legs = straight_legs(stance.mechanism)
    if legs is None:
        return None
    swings, stands = (stance.pose.motion.angles[j] for j in legs)
    return swings, stands


def opening(scene: RigidScene, state: Any) -> Scalar:
    """Above zero while the swing foot is off the ground, where it is ahead [rad]."""
    return of_stance(scene, state, _opening)


def _opening(stance: Stance) -> Scalar:
    angles = _leg_angles(stance)
    if angles is not None:
        return angles[0] + angles[1]
    return _clearance(stance) / stance.mechanism.height


def lead(scene: RigidScene, state: Any) -> Scalar:
    """How far the swing foot is ahead [rad], above zero where it may strike."""
    return of_stance(scene, state, _lead)


def _lead(stance: Stance) -> Scalar:
    angles = _leg_angles(stance)
    if angles is not None:
        return angles[0] - angles[1]
    return _distance_ahead(stance) / stance.mechanism.height - _APART


def lean(scene: RigidScene, state: Any) -> Scalar:
    """Above zero while the root point is behind the standing foot [rad]."""
    return of_stance(scene, state, _lean)


def _lean(stance: Stance) -> Scalar:
    angles = _leg_angles(stance)
    if angles is not None:
        return angles[1]
    return (standing_place(stance) - stance.root.x) / stance.mechanism.height


def uprightness(scene: RigidScene, state: Any, side: Scalar) -> Scalar:
    """What is left before the walker has fallen, below zero afterwards [rad].

    `side` is the sign of `lean`.
    """
    return of_stance(scene, state, lambda stance: _uprightness(stance, side))


def _uprightness(stance: Stance, side: Scalar) -> Scalar:
    mechanism, angles = stance.mechanism, _leg_angles(stance)
    if angles is not None:
        return FALL_ANGLE - side * angles[1]
    return (stance.root.z - mechanism.height_over_feet(math.cos(FALL_ANGLE))) / mechanism.height


@kept_alone
def foot_ahead(scene: Any, state: PyTree) -> Scalar:
    """Computes how far ahead of the root point the stance leg's foot stands on a section [m]."""
    if is_rigid(scene):
        return of_stance(scene, state, lambda stance: standing_place(stance) - stance.root.x)
    return legs_at(scene, state)[scene.mechanism.structure.stance_leg].x

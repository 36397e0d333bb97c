"""Contacts: where the feet are and how they move, which touch, and the ground's forces on them."""

from typing import NamedTuple, cast

import jax.numpy as jnp

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar, select
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.dynamics._actuation import load_shares, preload
from jaxbiped.dynamics._redundant_state import CompliantState, Leg, legs_of
from jaxbiped.dynamics._state import SomeState, exchange_legs
from jaxbiped.scene._ground import drop_under
from jaxbiped.scene._scene import AbstractWalkerScene, CompliantScene
from jaxbiped.scene.actuation._abstract_actuator import HipMotion
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw
from jaxbiped.scene.laws.friction._coulomb import Frictionless

_JUST_TOUCHING = 1e-6
"""Depth or height of a foot that counts as at the surface, in units of the leg's length."""


class Foot(NamedTuple):
    """Kinematics of one foot, leaves shaped as the state's.

    Attributes:
        x, z: centre of the foot in the slope's frame [m].
        vx, vz: velocity of that centre [m/s].
        penetration: δ = r − z, positive when indented, and the foot's extension where it has a
            preload [m].
        penetration_rate: δ̇ = −vz, and the rate of the extension [m/s].
        slip_speed: V_T = vx + r θ̇, tangential velocity of the material point in contact [m/s].
        admitted: whether the clearance rule lets the foot touch (boolean), None for "always",
            Python's False for "never".
        bristle: see `AbstractBristleLaw` [–]; None where friction has no memory.
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


class Feet(NamedTuple):
    """Kinematics of both feet.

    Attributes:
        foot_1, foot_2: of each leg's foot, leaves shaped as the state's.
    """

    foot_1: Foot
    foot_2: Foot


@kept_alone
def feet(scene: CompliantScene, state: CompliantState) -> Feet:
    """Both feet's kinematics (model: foot centre O = S + (l − r)(sin θ, −cos θ)).

    In redundant coordinates S is where the foot's own leg has the hip.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: leaves of any common shape, SI units.

    Returns:
        Positions [m], velocities [m/s] and penetrations [m] of both feet, leaves shaped as the
        state's.
    """
    return feet_of(scene, legs_of(scene, state))


def feet_of(scene: CompliantScene, legs: tuple[Leg, Leg]) -> Feet:
    """The feet at the ends of legs."""
    return Feet(_foot(scene, 1, legs[0]), _foot(scene, 2, legs[1]))


def _foot(scene: CompliantScene, number: int, leg: Leg) -> Foot:
    length, radius = scene.walker.hip_to_foot, scene.walker.r
    sine, cosine = leg.sine, leg.cosine
    x = leg.hip_x + length * sine
    z = leg.hip_z - length * cosine
    vx = leg.hip_vx + length * cosine * leg.rate
    vz = leg.hip_vz + length * sine * leg.rate
    depth, depth_rate = radius - z, -vz
    drop = drop_under(scene.ground, number)
    if drop is not None:
        depth = depth - drop
    moved = preload(scene, leg.angle, leg.rate)
    if moved is not None:
        depth, depth_rate = depth + moved[0], depth_rate + moved[1]
    return Foot(
        x=x,
        z=z,
        vx=vx,
        vz=vz,
        penetration=depth,
        penetration_rate=depth_rate,
        slip_speed=vx + radius * leg.rate,
        admitted=scene.clearance.admits(number, leg.rate),
        bristle=leg.bristle,
    )


@kept_alone
def touches(foot: Foot) -> Scalar:
    """Whether the foot is in contact (boolean): indented and admitted by the clearance rule.

    Args:
        foot: kinematics of one foot, see `feet`.

    Returns:
        Booleans shaped as the state's leaves.
    """
    below = foot.penetration > 0.0
    return below if foot.admitted is None else below & foot.admitted


@kept_alone
def landings(before: Feet, after: Feet) -> tuple[Scalar, Scalar]:
    """Whether each foot comes to touch between two moments and is the one ahead (booleans).

    Such a landing is a heel strike where the other foot made the one before.
    """

    def lands(i: int) -> Scalar:
        newly = ~touches(before[i]) & touches(after[i])
        return newly & (after[i].x > after[1 - i].x)

    return lands(0), lands(1)


@kept_alone
def standing_foot(both: Feet) -> Scalar:
    """The foot that alone touches: 1 or 2, or 0 where none or both do."""
    touch_1, touch_2 = touches(both.foot_1), touches(both.foot_2)
    return jnp.where(touch_1 & ~touch_2, 1, jnp.where(touch_2 & ~touch_1, 2, 0))


@kept_alone
def with_leg_2_standing(scene: CompliantScene, state: SomeState) -> SomeState:
    """The same motion in the names that sections are looked at in: leg 2 stands.

    Where leg 1 stands alone the names are exchanged, but for a state at leg 2's heel strike, whose
    foot just touches: it carries from there on.
    """
    both = feet(scene, cast("CompliantState", state))
    strikes = jnp.abs(both.foot_2.penetration) <= _JUST_TOUCHING * scene.walker.l
    return select((standing_foot(both) == 1) & ~strikes, exchange_legs(state), state)


def standing_height(
    scene: AbstractWalkerScene, stance_angle: Scalar, penetration: Scalar | float = 0.0
) -> Scalar:
    """Height of the hip over a leg that stands on its foot.

    Args:
        scene: the walker on its ground.
        stance_angle: of that leg from the slope's normal [rad].
        penetration: how deep its foot indents the ground [m].

    Returns:
        The hip's height above the slope [m], of the broadcast shape.
    """
    walker = scene.walker
    return walker.r - penetration + walker.hip_to_foot * jnp.cos(stance_angle)


class FootForce(NamedTuple):
    """Force of the ground on one foot.

    Attributes:
        normal: F_N along the slope's outward normal [N], never negative.
        tangential: along the slope, downhill positive [N]; None where the scene has no friction.
    """

    normal: Scalar
    tangential: Scalar | None


def foot_force(scene: CompliantScene, foot: Foot) -> FootForce:
    """Force on a foot whose kinematics are known."""
    if foot.admitted is False:
        nothing = jnp.zeros_like(foot.penetration)
        return FootForce(nothing, None if isinstance(scene.friction, Frictionless) else nothing)
    normal = scene.normal.force(foot.penetration, foot.penetration_rate)
    if foot.admitted is not None:
        normal = jnp.where(foot.admitted, normal, 0.0)
    if isinstance(scene.friction, Frictionless):
        return FootForce(normal, None)
    if isinstance(scene.friction, AbstractBristleLaw):
        if foot.bristle is None:
            raise ArgumentError(
                f"state has no bristles, which friction = {type(scene.friction).__name__} needs: "
                "give a BristleState."
            )
        return FootForce(normal, scene.friction.force(normal, foot.slip_speed, foot.bristle))
    return FootForce(normal, scene.friction.force(normal, foot.slip_speed))


class FootForces(NamedTuple):
    """Forces of the ground on both feet.

    Attributes:
        foot_1, foot_2: on each leg's foot, leaves shaped as the state's [N].
    """

    foot_1: FootForce
    foot_2: FootForce


@kept_alone
def foot_forces(scene: CompliantScene, state: CompliantState) -> FootForces:
    """Forces on both feet at a state; leaves shaped as the state's.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: leaves of any common shape, SI units.

    Returns:
        Normal and tangential force on each foot [N], leaves shaped as the state's.

    Raises:
        ArgumentError: a state without the bristles that the scene's friction needs.
    """
    both = feet(scene, state)
    return FootForces(foot_force(scene, both.foot_1), foot_force(scene, both.foot_2))


class Contacts(NamedTuple):
    """Feet, whether each touches, and the forces on them; leaves shaped as the state's."""

    feet: Feet
    touching: tuple[Scalar, Scalar]
    forces: FootForces

    @property
    def both_carry(self) -> Scalar:
        """Whether both feet carry something (boolean): double support."""
        return (self.forces.foot_1.normal > 0.0) & (self.forces.foot_2.normal > 0.0)


def contacts(scene: CompliantScene, state: CompliantState) -> Contacts:
    """Both feet's contacts with the ground."""
    both = feet(scene, state)
    first, second = (jnp.broadcast_to(touches(foot), foot.x.shape) for foot in both)
    return Contacts(both, (first, second), foot_forces(scene, state))


def normal_forces(scene: CompliantScene, both: Feet) -> tuple[Scalar | None, Scalar | None]:
    """Normal force on each foot [N]; None for one that is known never to touch."""

    def force(foot: Foot) -> Scalar | None:
        return None if foot.admitted is False else foot_force(scene, foot).normal

    return force(both.foot_1), force(both.foot_2)


def hip_motion(
    scene: CompliantScene,
    both: Feet,
    angle: tuple[Scalar, Scalar],
    rate: tuple[Scalar, Scalar],
) -> HipMotion:
    """What actuators at the hip of a compliant walker know of it."""
    return HipMotion(angle, rate, load_shares(scene, normal_forces(scene, both)))

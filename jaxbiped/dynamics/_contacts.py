"""Contacts: the feet, which touch, how far they slid, the forces on them, and gaps that close."""

import functools
from typing import NamedTuple, cast

import jax.numpy as jnp

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import Scalar, select
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._actuation import load_shares, preload
from jaxbiped.dynamics._equivalent_states import CompliantState, exchange_legs, motion_in, poses_of
from jaxbiped.dynamics._footfalls import (
    FootMotion,
    LegMotion,
    leg_depth,
    leg_motions,
    standing_leg,
    touches,
)
from jaxbiped.dynamics._joint_loads import Pressed, stop_limits
from jaxbiped.dynamics._tree import Motion, Pose, point_motion
from jaxbiped.scene._ground import SteppedGround
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._scene import CompliantScene, RedundantScene, Scene
from jaxbiped.scene._state_types import SomeState
from jaxbiped.scene._structure import Structure
from jaxbiped.scene.actuation._actuators import HipMotion
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw, AbstractNormalLaw
from jaxbiped.scene.laws.friction._coulomb import Frictionless

_JUST_TOUCHING = 1e-6
"""Depth or height of a foot that counts as at the surface, in units of the leg's length."""


@kept_alone
def feet(scene: CompliantScene, state: CompliantState) -> tuple[FootMotion, ...]:
    """Kinematics of all feet of a walker, in the order of its mechanism.

    In redundant coordinates, the position of the root point is that on the foot's own leg.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: leaves of any common shape, SI units.

    Returns:
        Positions [m], velocities [m/s] and penetrations [m] of each foot, leaves shaped as the
        state's.
    """
    return feet_at(scene, poses_of(scene, state), bristles_of(scene, state))


def bristles_of(scene: CompliantScene, state: CompliantState) -> tuple[Scalar | None, ...]:
    """The bristles of each foot [–]; None where a state has none."""
    return tuple(getattr(state, name, None) for name in scene.mechanism.structure.bristles)


def feet_at(
    scene: CompliantScene, poses: tuple[Pose, ...], bristles: tuple[Scalar | None, ...]
) -> tuple[FootMotion, ...]:
    """The feet of bodies in these poses."""
    check_type("scene", scene, Scene, RedundantScene)
    ground: object = scene.ground
    structure, given = scene.mechanism.structure, scene.mechanism.feet
    points = tuple(
        point_motion(structure, poses[body], body, foot.centre)
        for body, foot in zip(structure.feet, given, strict=True)
    )
    legs = leg_motions(structure, poses, points)
    admitted = [
        scene.clearance.admits(name, leg.rate)
        for name, leg in zip(structure.legs, legs, strict=True)
    ]
    found = []
    for k, (body, leg) in enumerate(zip(structure.feet, structure.leg_of_foot, strict=True)):
        point, radius = points[k], given[k].radius
        depth, depth_rate = -point.z, -point.vz
        slip = point.vx
        if radius is not None:
            depth, slip = radius - point.z, point.vx + radius * poses[body].motion.rates[body]
        if isinstance(ground, SteppedGround) and leg == ground.leg:
            depth = depth - ground.drop
        moved = preload(scene, legs[leg])
        if moved is not None:
            depth, depth_rate = depth + moved[0], depth_rate + moved[1]
        place = point.x, point.z, point.vx, point.vz
        found.append(FootMotion(*place, depth, depth_rate, slip, admitted[leg], bristles[k]))
    return tuple(found)


def legs_at(scene: CompliantScene, state: CompliantState) -> tuple[LegMotion, ...]:
    """Each leg's line from the root point to the mean of its feet."""
    return legs_in(scene.mechanism, poses_of(scene, state))


def legs_in(mechanism: Mechanism, poses: tuple[Pose, ...]) -> tuple[LegMotion, ...]:
    """Each leg's line where bodies are in these poses."""
    structure = mechanism.structure
    points = [
        point_motion(structure, poses[body], body, foot.centre)
        for body, foot in zip(structure.feet, mechanism.feet, strict=True)
    ]
    return leg_motions(structure, poses, points)


@kept_alone
def with_stance_leg_standing(scene: CompliantScene, state: SomeState) -> SomeState:
    """The same motion in the names that sections are looked at in: the stance leg stands.

    Where a leg that may have its name stands alone the names are exchanged, but for a state at the
    stance leg's heel strike, whose foot just touches: it carries from there on. Without a symmetry
    the names stay.
    """
    mechanism = scene.mechanism
    structure = mechanism.structure
    _, *names = structure.namings
    if not names:
        return state
    images = [(leg, exchange_legs(scene, state, k)) for k, leg in enumerate(names, 1)]
    leg, found = structure.stance_leg, feet(scene, cast("CompliantState", state))
    strikes = jnp.abs(leg_depth(structure, found, leg)) <= _JUST_TOUCHING * mechanism.height
    stands = standing_leg(structure, found)
    for other, image in reversed(images):
        state = select((stands == 1 + other) & ~strikes, image, state)
    return state


class FootForce(NamedTuple):
    """Force of the ground on one foot.

    Attributes:
        normal: normal force F_N along the slope's outward normal [N], never negative.
        tangential: tangential force along the slope, downhill positive [N]; None if the scene has
            no friction.
    """

    normal: Scalar
    tangential: Scalar | None


def foot_force(scene: CompliantScene, foot: FootMotion) -> FootForce:
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


class Contacts(NamedTuple):
    """Feet, whether each touches, and the forces on them; leaves shaped as the state's."""

    feet: tuple[FootMotion, ...]
    touching: tuple[Scalar, ...]
    forces: tuple[FootForce, ...]


def contacts(scene: CompliantScene, state: CompliantState) -> Contacts:
    """All feet's contacts with the ground."""
    found = feet(scene, state)
    touching = tuple(jnp.broadcast_to(touches(foot), foot.x.shape) for foot in found)
    return Contacts(found, touching, tuple(foot_force(scene, foot) for foot in found))


def normal_forces(
    scene: CompliantScene, found: tuple[FootMotion, ...]
) -> tuple[Scalar | None, ...]:
    """Normal force on each foot [N]; None for one that is known never to touch."""
    return tuple(
        None if foot.admitted is False else foot_force(scene, foot).normal for foot in found
    )


def leg_loads(structure: Structure, shares: tuple[Scalar | None, ...]) -> tuple[Scalar | None, ...]:
    """Share of the load on each leg; None for one that never touches."""
    found: list[Scalar | None] = []
    for feet_of in structure.feet_of_leg:
        own = [share for k in feet_of if (share := shares[k]) is not None]
        found.append(sum(own[1:], own[0]) if own else None)
    return tuple(found)


def hip_motion(scene: CompliantScene, found: tuple[FootMotion, ...], motion: Motion) -> HipMotion:
    """What actuators at the hip of a compliant walker know of it: of the mirror's first pair."""
    structure = scene.mechanism.structure
    pair = structure.pairs[0]  # there is one: else the scene has refused such actuators
    shares = load_shares(scene, normal_forces(scene, found))
    loads: list[Scalar | None] = []
    for body in pair:
        carried = [
            share
            for share, own in zip(shares, structure.feet, strict=True)
            if share is not None and body in structure.chains[own]
        ]
        loads.append(sum(carried[1:], carried[0]) if carried else None)
    first, second = pair
    angles, rates = motion.angles, motion.rates
    hip = HipMotion(
        (angles[first], angles[second]), (rates[first], rates[second]), (loads[0], loads[1])
    )
    return hip.timed(motion.clock)


def limits_of(
    scene: CompliantScene, state: CompliantState
) -> tuple[tuple[AbstractNormalLaw, Pressed], ...]:
    """Every limit of the stops of a scene with its law."""
    motion = motion_in(scene, state)
    return stop_limits(scene.mechanism, motion, scene.ground.slope)


def contact_places(scene: CompliantScene, state: CompliantState) -> tuple[Scalar, ...]:
    """For each foot, the place [m] that changes by what it slips: its rate is the slip speed."""
    mechanism, angles = scene.mechanism, motion_in(scene, state).angles
    parts = zip(feet(scene, state), mechanism.feet, mechanism.structure.feet, strict=True)
    return tuple(
        found.x if foot.radius is None else found.x + foot.radius * angles[body]
        for found, foot, body in parts
    )


def slip_distances(
    scene: CompliantScene, state: CompliantState, landed: tuple[Scalar, ...]
) -> tuple[tuple[Scalar, ...], Scalar]:
    """The places at which the feet last came down, and how far the worst one has slid since [m].

    `landed` are these places a step ago; see `contact_places`.
    """
    found, places = feet(scene, state), contact_places(scene, state)
    kept = tuple(
        jnp.where(touches(foot), old, new)
        for foot, old, new in zip(found, landed, places, strict=True)
    )
    slid = [jnp.abs(new - old) for old, new in zip(kept, places, strict=True)]
    return kept, functools.reduce(jnp.maximum, slid)

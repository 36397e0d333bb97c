"""Equations of motion in redundant coordinates: each leg its own body, joined at the hip."""

from typing import NamedTuple, cast

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._circular import sine_cosine
from jaxbiped._types import RealScalarLike, Scalar, Time, VectorField
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.constraints._linkage import constraints_of, headings_of, point_of, torque_on
from jaxbiped.dynamics._actuation import hip_torques
from jaxbiped.dynamics._contacts import feet, feet_of, foot_force, hip_motion
from jaxbiped.dynamics._linkage_motion import LinkageMotion, motion_under
from jaxbiped.dynamics._minimal_motion import Accelerations, accelerations, bristle_rates
from jaxbiped.dynamics._redundant_state import Leg, LegsState, legs_of
from jaxbiped.dynamics._state import field_of
from jaxbiped.scene._scene import AbstractWalkerScene, CompliantScene, RedundantScene
from jaxbiped.scene._walker import leg_of
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw


class HipForce(NamedTuple):
    """Force of the hip on leg 1 in the slope's frame, leaves shaped as the state's.

    On leg 2 it is the opposite, but for what a mass at the hip takes.

    Attributes:
        x: along the slope, downhill positive [N].
        z: along its outward normal [N].
    """

    x: Scalar
    z: Scalar


class Violation(NamedTuple):
    """How far a redundant state is off its constraints, leaves shaped as the state's.

    Attributes:
        position: distance between the hips of the two legs, ‖Φ‖ [m].
        rate: their relative speed, ‖Φ̇‖ [m/s].
        normalisation: largest | cos² + sin² − 1 | of a leg's Euler parameters; 0 without them.
    """

    position: RealScalarLike
    rate: RealScalarLike
    normalisation: RealScalarLike


class RedundantMotion(NamedTuple):
    """How a redundant walker moves at a state, leaves shaped as the state's.

    Attributes:
        accelerations: of the coordinates in the state's order [m/s², rad/s², 1/s²]: six, or eight
            with Euler parameters.
        hip_force: of the hip on leg 1 [N].
        minimal: the same motion in minimal coordinates, the hip half way between the legs' two.
    """

    accelerations: list[Scalar]
    hip_force: HipForce
    minimal: Accelerations


def coordinates_of(scene: RedundantScene, state: LegsState) -> tuple[list[Scalar], list[Scalar]]:
    """Coordinates and rates of a redundant state as the linkage has them."""
    count = 2 * scene.linkage.coordinates
    leaves = cast("tuple[Scalar, ...]", state)
    return list(leaves[:count]), list(leaves[count : 2 * count])


def with_coordinates(state: PyTree, q: list[Scalar], v: list[Scalar]) -> LegsState:
    """The state with other coordinates and rates; bristles stay."""
    return type(state)(*q, *v, state.bristle_1, state.bristle_2)


@kept_alone
def redundant_motion(scene: RedundantScene, state: LegsState) -> RedundantMotion:
    """Accelerations and the hip's reaction by the scene's method.

    Args:
        scene: the walker and its constraint method.
        state: redundant, leaves of any common shape, SI units.

    Returns:
        Accelerations [m/s², rad/s²] and the hip's force on leg 1 [N], leaves shaped as the state's.
    """
    q, v = coordinates_of(scene, state)
    moved = _linkage_motion(scene, state)
    minimal, hip = _minimal_accelerations(scene, q, v, moved.accelerations)
    (force_x, force_z), half = moved.joint_forces[0], 0.5 * scene.walker.hip_mass
    downhill, weight = _gravity(scene)
    force = HipForce(force_x - half * (hip[0] - downhill), force_z - half * (hip[1] - weight))
    return RedundantMotion(moved.accelerations, force, minimal)


@kept_alone
def redundant_field(t: Time, state: LegsState, scene: RedundantScene) -> LegsState:
    """Time derivative of a redundant state, in the form that `diffrax.ODETerm` takes.

    Args:
        t: time [s]; the field does not depend on it.
        state: redundant, leaves of any common shape, SI units.
        scene: the walker and its constraint method.

    Returns:
        The rates of change [SI units per second], a state of the same kind and shape.
    """
    _, v = coordinates_of(scene, state)
    moved = _linkage_motion(scene, state)
    memory = {}
    if isinstance(scene.friction, AbstractBristleLaw):
        memory = bristle_rates(scene.friction, scene, state)
    return with_coordinates(state, v, moved.accelerations)._replace(**memory)


@field_of.register
def _(scene: RedundantScene) -> VectorField:
    return redundant_field


@kept_alone
def violation(scene: RedundantScene, state: LegsState) -> Violation:
    """How far apart the two legs' hips are, and how fast they part.

    Args:
        scene: the walker and its constraint method.
        state: redundant, leaves of any common shape, SI units.

    Returns:
        Distance [m], relative speed [m/s] and normalisation [–], leaves shaped as the state's.
    """
    at = constraints_of(scene.linkage, *coordinates_of(scene, state))
    off = jnp.zeros_like(at.violation[0])
    for value in at.violation[2:]:
        off = jnp.maximum(off, jnp.abs(value))
    return Violation(jnp.hypot(*at.violation[:2]), jnp.hypot(*at.rate[:2]), off)


@kept_alone
def hip_force(scene: CompliantScene, state: PyTree) -> HipForce:
    """The hip's reaction on leg 1, in either formulation.

    In minimal coordinates it does no work and is in no equation: it is what Newton's law for leg 1
    leaves open, m (a − g) less the ground's force.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: of the scene's kind, leaves of any common shape, SI units.

    Returns:
        The force [N], leaves shaped as the state's.
    """
    if isinstance(scene, RedundantScene):
        return redundant_motion(scene, state).hip_force
    walker, second = scene.walker, accelerations(scene, state)
    sine, cosine = sine_cosine(state.theta_1)
    turning, square = walker.d * second.alpha_1, walker.d * state.omega_1 * state.omega_1
    downhill, weight = _gravity(scene)
    ax = second.hip_ax + turning * cosine - square * sine
    az = second.hip_az + turning * sine + square * cosine
    reaction = foot_force(scene, feet(scene, state).foot_1)
    tangential = 0.0 if reaction.tangential is None else reaction.tangential
    return HipForce(
        walker.m * (ax - downhill) - tangential, walker.m * (az - weight) - reaction.normal
    )


def _gravity(scene: AbstractWalkerScene) -> tuple[Scalar, Scalar]:
    ground = scene.ground
    return ground.g * jnp.sin(ground.slope), -ground.g * jnp.cos(ground.slope)


def _linkage_motion(scene: RedundantScene, state: LegsState) -> LinkageMotion:
    q, v = coordinates_of(scene, state)
    legs = legs_of(scene, state)
    headings = headings_of(scene.linkage, q, v, [(leg.sine, leg.cosine) for leg in legs])
    return motion_under(
        scene.linkage, scene.method, q, v, _applied_forces(scene, state, legs), headings
    )


def _applied_forces(scene: RedundantScene, state: LegsState, legs: tuple[Leg, Leg]) -> list[Scalar]:
    """Forces of gravity, ground and actuators on each leg, from that leg's own coordinates."""
    walker, linkage = scene.walker, scene.linkage
    body, distance = leg_of(walker)
    downhill, weight = _gravity(scene)
    reach, size = walker.hip_to_foot - distance, linkage.coordinates
    applied: list[Scalar] = []
    both = feet_of(scene, legs)
    driving = None
    if scene.actuation is not None:
        angles, rates = (legs[0].angle, legs[1].angle), (legs[0].rate, legs[1].rate)
        driving = hip_torques(scene, hip_motion(scene, both, angles, rates))
    for k, (leg, foot) in enumerate(zip(legs, both, strict=True)):
        force_x, force_z = body.mass * downhill, body.mass * weight
        torque = jnp.zeros_like(leg.rate)
        if foot.admitted is not False:
            reaction = foot_force(scene, foot)
            force_z = force_z + reaction.normal
            torque = reaction.normal * (reach * leg.sine)
            if reaction.tangential is not None:
                force_x = force_x + reaction.tangential
                torque = torque + reaction.tangential * (reach * leg.cosine + walker.r)
        if driving is not None:
            torque = torque + driving[k]
        own = cast("tuple[Scalar, ...]", state)[size * k : size * (k + 1)]
        applied += [force_x, force_z, *torque_on(linkage, own, torque)]
    return applied


def _minimal_accelerations(
    scene: RedundantScene, q: list[Scalar], v: list[Scalar], second: list[Scalar]
) -> tuple[Accelerations, tuple[Scalar, Scalar]]:
    """Accelerations in minimal coordinates, and of the hip as leg 1 has it."""
    linkage, joint = scene.linkage, scene.linkage.joints[0]
    headings = headings_of(linkage, q, v)
    hips, turning = [], []
    for k in range(2):
        hip = point_of(linkage, q, headings, k, joint.point_1)
        ax = sum((entry * second[c] for c, entry in hip.row_x.items()), hip.convective_x)
        az = sum((entry * second[c] for c, entry in hip.row_z.items()), hip.convective_z)
        hips.append((ax, az))
        own = slice(linkage.coordinates * k + 2, linkage.coordinates * (k + 1))
        if linkage.orientation == "angle":
            turning.append(second[own][0])
        else:
            (c, s), (c_second, s_second) = q[own], second[own]
            turning.append(2.0 * (c * s_second - s * c_second))
    (ax_1, az_1), (ax_2, az_2) = hips
    means = (0.5 * (ax_1 + ax_2), 0.5 * (az_1 + az_2))
    return Accelerations(*means, *turning), hips[0]

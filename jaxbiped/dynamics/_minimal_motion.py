"""Equations of motion in minimal coordinates: hip x, hip z and two leg angles."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._circular import sine_cosine
from jaxbiped._types import Scalar, Time, VectorField
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.dynamics._actuation import hip_torques
from jaxbiped.dynamics._contacts import Feet, Foot, feet, foot_force, hip_motion
from jaxbiped.dynamics._redundant_state import CompliantState
from jaxbiped.dynamics._state import State, field_of
from jaxbiped.scene._scene import CompliantScene, Scene
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw


class Accelerations(NamedTuple):
    """Second derivatives of the coordinates, leaves shaped as the state's.

    Attributes:
        hip_ax, hip_az: of the hip in the slope's frame [m/s²].
        alpha_1, alpha_2: of the legs [rad/s²].
    """

    hip_ax: Scalar
    hip_az: Scalar
    alpha_1: Scalar
    alpha_2: Scalar


class LegLoad(NamedTuple):
    """What one leg brings to the equations of motion.

    Attributes:
        force_x, force_z: ground reaction and centrifugal force that reach the hip [N].
        torque: of ground reaction, gravity and actuators about the hip [N·m].
        coupling_x, coupling_z: m d cos θ and m d sin θ, inertial coupling to the hip [kg·m].
        inertia: about the hip, J + m d² [kg·m²].
    """

    force_x: Scalar
    force_z: Scalar
    torque: Scalar
    coupling_x: Scalar
    coupling_z: Scalar
    inertia: Scalar


def leg_load(scene: Scene, angle: Scalar, rate: Scalar, foot: Foot) -> LegLoad:
    """Forces, torque and inertia of the leg at `angle` [rad] turning at `rate` [rad/s]."""
    walker, ground = scene.walker, scene.ground
    sine, cosine = sine_cosine(angle)
    moment = walker.m * walker.d
    coupling_x, coupling_z = moment * cosine, moment * sine
    downhill, weight = ground.g * jnp.sin(ground.slope), ground.g * jnp.cos(ground.slope)
    force_x, force_z = coupling_z * rate * rate, -coupling_x * rate * rate
    torque = coupling_x * downhill - coupling_z * weight
    # Where it is known that a foot never touches, nothing of its contact is in the program.
    if foot.admitted is not False:
        reaction = foot_force(scene, foot)
        force_z = force_z + reaction.normal
        torque = torque + reaction.normal * (walker.hip_to_foot * sine)
        if reaction.tangential is not None:
            force_x = force_x + reaction.tangential
            torque = torque + reaction.tangential * (walker.hip_to_foot * cosine + walker.r)
    inertia = walker.J + moment * walker.d
    return LegLoad(force_x, force_z, torque, coupling_x, coupling_z, inertia)


def leg_acceleration(leg: LegLoad, hip_ax: Scalar, hip_az: Scalar) -> Scalar:
    """Angular acceleration [rad/s²] of a leg whose hip accelerates by (hip_ax, hip_az) [m/s²]."""
    return (leg.torque - leg.coupling_x * hip_ax - leg.coupling_z * hip_az) / leg.inertia


@kept_alone
def accelerations(scene: Scene, state: State) -> Accelerations:
    """Accelerations at a state; leaves shaped as the state's.

    The legs' accelerations are eliminated from the 4 × 4 mass matrix, and the 2 × 2 system that
    is left for the hip is solved in closed form.

    Args:
        scene: the walker on its ground.
        state: leaves of any common shape, SI units.

    Returns:
        Hip [m/s²] and legs [rad/s²], leaves shaped as the state's.
    """
    both = feet(scene, state)
    legs = (
        leg_load(scene, state.theta_1, state.omega_1, both.foot_1),
        leg_load(scene, state.theta_2, state.omega_2, both.foot_2),
    )
    if scene.actuation is not None:
        legs = _with_torques(scene, state, both, legs)
    mass, ground = scene.walker.total_mass, scene.ground
    m_xx, m_xz, m_zz = mass, jnp.zeros_like(mass), mass
    f_x = mass * ground.g * jnp.sin(ground.slope)
    f_z = -mass * ground.g * jnp.cos(ground.slope)
    for leg in legs:
        m_xx = m_xx - leg.coupling_x * leg.coupling_x / leg.inertia
        m_xz = m_xz - leg.coupling_x * leg.coupling_z / leg.inertia
        m_zz = m_zz - leg.coupling_z * leg.coupling_z / leg.inertia
        f_x = f_x + leg.force_x - leg.coupling_x * leg.torque / leg.inertia
        f_z = f_z + leg.force_z - leg.coupling_z * leg.torque / leg.inertia
    determinant = m_xx * m_zz - m_xz * m_xz
    hip_ax = (m_zz * f_x - m_xz * f_z) / determinant
    hip_az = (m_xx * f_z - m_xz * f_x) / determinant
    return Accelerations(
        hip_ax,
        hip_az,
        leg_acceleration(legs[0], hip_ax, hip_az),
        leg_acceleration(legs[1], hip_ax, hip_az),
    )


def _with_torques(
    scene: Scene, state: State, both: Feet, legs: tuple[LegLoad, LegLoad]
) -> tuple[LegLoad, LegLoad]:
    """The legs' loads with the torques of the actuators."""
    rates = (state.omega_1, state.omega_2)
    hip = hip_motion(scene, both, (state.theta_1, state.theta_2), rates)
    torques = hip_torques(scene, hip)
    if torques is None:
        return legs
    first, second = (
        leg._replace(torque=leg.torque + torque) for leg, torque in zip(legs, torques, strict=True)
    )
    return first, second


def bristle_rates(
    law: AbstractBristleLaw, scene: CompliantScene, state: CompliantState
) -> dict[str, Scalar]:
    """Rates of both feet's bristles by their names in the state [1/s]."""
    rates = {}
    for name, foot in zip(("bristle_1", "bristle_2"), feet(scene, state), strict=True):
        load = foot_force(scene, foot).normal  # refuses a foot without a bristle
        assert foot.bristle is not None
        rates[name] = law.bristle_rate(load, foot.slip_speed, foot.bristle)
    return rates


@kept_alone
def vector_field(t: Time, state: State, scene: Scene) -> State:
    """Time derivative of the state, in the form that `diffrax.ODETerm` takes.

    Args:
        t: time [s]; the field does not depend on it.
        state: leaves of any common shape, SI units.
        scene: the walker on its ground.

    Returns:
        The rates of change [SI units per second], a state of the same kind and shape.
    """
    second = accelerations(scene, state)
    memory = {}
    if isinstance(scene.friction, AbstractBristleLaw):
        memory = bristle_rates(scene.friction, scene, state)
    return type(state)(
        **memory,
        hip_x=state.hip_vx,
        hip_z=state.hip_vz,
        theta_1=state.omega_1,
        theta_2=state.omega_2,
        hip_vx=second.hip_ax,
        hip_vz=second.hip_az,
        omega_1=second.alpha_1,
        omega_2=second.alpha_2,
    )


@field_of.register
def _(scene: Scene) -> VectorField:
    return vector_field

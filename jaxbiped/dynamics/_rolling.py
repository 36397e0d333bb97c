"""Single support of the rigid walker: leg 2 rolls without slip, leg 1 swings."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._circular import sine_cosine
from jaxbiped._types import Scalar, Time, VectorField
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.dynamics._actuation import hip_torques
from jaxbiped.dynamics._contacts import FootForce
from jaxbiped.dynamics._state import RigidState, field_of
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._walker import Walker
from jaxbiped.scene.actuation._abstract_actuator import HipMotion


class Support(NamedTuple):
    """Geometry of a leg that rolls without slip: velocities for each unit of its rate [m].

    Attributes:
        hip_x, hip_z: of the hip.
        mass_x, mass_z: of the leg's centre of mass.
        sine, cosine: of the leg's angle.
    """

    hip_x: Scalar
    hip_z: Scalar
    mass_x: Scalar
    mass_z: Scalar
    sine: Scalar
    cosine: Scalar


def support_of(walker: Walker, angle: Scalar) -> Support:
    """Geometry of a stance leg at `angle` [rad]: its foot's centre moves by −r θ̇ along x."""
    sine, cosine = sine_cosine(angle)
    reach, below = walker.hip_to_foot, walker.hip_to_foot - walker.d
    return Support(
        hip_x=-(walker.r + reach * cosine),
        hip_z=-reach * sine,
        mass_x=-(walker.r + below * cosine),
        mass_z=-below * sine,
        sine=sine,
        cosine=cosine,
    )


class Inertia(NamedTuple):
    """Symmetric mass matrix of (stance rate, swing rate) [kg·m²]."""

    stance: Scalar
    coupling: Scalar
    swing: Scalar

    def solved(self, stance: Scalar, swing: Scalar) -> tuple[Scalar, Scalar]:
        """The rates or accelerations (stance, swing) that belong to these momenta or torques.

        The swing leg is eliminated first: its mass may be far below the hip's.
        """
        inverse = 1.0 / self.swing  # a number of the walker: divided once, not at every stage
        ratio = self.coupling * inverse
        of_stance = (stance - ratio * swing) / (self.stance - ratio * self.coupling)
        return of_stance, swing * inverse - ratio * of_stance


def inertia_of(walker: Walker, stance: Support, sine: Scalar, cosine: Scalar) -> Inertia:
    """Mass matrix; sine and cosine are those of the swing leg's angle."""
    carried = walker.hip_mass + walker.m
    of_hip = stance.hip_x * stance.hip_x + stance.hip_z * stance.hip_z
    of_leg = stance.mass_x * stance.mass_x + stance.mass_z * stance.mass_z
    return Inertia(
        stance=carried * of_hip + walker.m * of_leg + walker.J,
        coupling=walker.m * walker.d * (stance.hip_x * cosine + stance.hip_z * sine),
        swing=walker.J + walker.m * walker.d * walker.d,
    )


def rolling_hip_motion(state: RigidState) -> HipMotion:
    """What actuators at the hip know of the rigid walker: leg 2 carries it alone."""
    one = jnp.ones_like(state.theta_2)
    return HipMotion((state.theta_1, state.theta_2), (state.omega_1, state.omega_2), (None, one))


class Rates(NamedTuple):
    """Angular accelerations in single support [rad/s²]: of swing leg and stance leg."""

    alpha_1: Scalar
    alpha_2: Scalar


def rolling_rates(scene: RigidScene, state: RigidState) -> Rates:
    """Angular accelerations at a state; leaves shaped as the state's.

    Lagrange's equations of the two angles, with all that does not change gathered: of the stance
    leg's inertia only one term does. By the sources' symbols: l − r is hip to foot centre, d hip to
    centre of mass.
    """
    walker, ground = scene.walker, scene.ground
    m, d, r = walker.m, walker.d, walker.r
    reach, below, carried = walker.hip_to_foot, walker.hip_to_foot - d, walker.hip_mass + m
    g_x, g_z = ground.g * jnp.sin(ground.slope), -ground.g * jnp.cos(ground.slope)
    moment = carried * reach + m * below
    fixed = walker.total_mass * r * r + carried * reach * reach + m * below * below + walker.J
    swing_inertia = walker.J + m * d * d
    sine_1, cosine_1 = sine_cosine(state.theta_1)
    sine_2, cosine_2 = sine_cosine(state.theta_2)
    sine = sine_1 * cosine_2 - cosine_1 * sine_2
    cosine = cosine_1 * cosine_2 + sine_1 * sine_2
    swing_square, stance_square = state.omega_1 * state.omega_1, state.omega_2 * state.omega_2
    inertia = Inertia(
        stance=fixed + 2.0 * r * moment * cosine_2,
        coupling=-(m * d * r * cosine_1 + m * d * reach * cosine),
        swing=swing_inertia,
    )
    swing_torque = m * d * g_x * cosine_1 + m * d * g_z * sine_1
    swing_torque = swing_torque + m * d * reach * sine * stance_square
    stance_torque = r * moment * sine_2 * stance_square - (
        walker.total_mass * r * g_x + moment * g_x * cosine_2 + moment * g_z * sine_2
    )
    stance_torque = stance_torque - swing_square * (m * d * r * sine_1 + m * d * reach * sine)
    if scene.actuation is not None:
        torques = hip_torques(scene, rolling_hip_motion(state))
        if torques is not None:
            swing_torque, stance_torque = swing_torque + torques[0], stance_torque + torques[1]
    alpha_2, alpha_1 = inertia.solved(stance_torque, swing_torque)
    return Rates(alpha_1, alpha_2)


class RollingMotion(NamedTuple):
    """Accelerations in single support.

    Attributes:
        alpha_1, alpha_2: of swing and stance leg [rad/s²].
        force: of the ground on the stance foot, that keeps it rolling [N]. A foot that it would
            have to pull has flown.
    """

    alpha_1: Scalar
    alpha_2: Scalar
    force: FootForce


@kept_alone
def rolling(scene: RigidScene, state: RigidState) -> RollingMotion:
    """Accelerations and the ground's reaction at a state; leaves shaped as the state's.

    The reaction is what the accelerations of hip and centres of mass leave of the weight.

    Args:
        scene: the rigid walker.
        state: leaves of any common shape, SI units.

    Returns:
        Leg accelerations [rad/s²] and the force on the stance foot [N], leaves shaped as the
        state's.
    """
    walker, ground = scene.walker, scene.ground
    alpha_1, alpha_2 = rolling_rates(scene, state)
    stance = support_of(walker, state.theta_2)
    sine, cosine = sine_cosine(state.theta_1)
    stance_square, swing_square = state.omega_2**2, state.omega_1**2
    reach, below = walker.hip_to_foot, walker.hip_to_foot - walker.d
    hip_x = stance.hip_x * alpha_2 + reach * stance.sine * stance_square
    hip_z = stance.hip_z * alpha_2 - reach * stance.cosine * stance_square
    own_x = stance.mass_x * alpha_2 + below * stance.sine * stance_square
    own_z = stance.mass_z * alpha_2 - below * stance.cosine * stance_square
    swing_x = walker.d * (cosine * alpha_1 - sine * swing_square)
    swing_z = walker.d * (sine * alpha_1 + cosine * swing_square)
    carried, total = walker.hip_mass + walker.m, walker.total_mass
    weight_x = total * ground.g * jnp.sin(ground.slope)
    weight_z = -total * ground.g * jnp.cos(ground.slope)
    force = FootForce(
        normal=carried * hip_z + walker.m * (own_z + swing_z) - weight_z,
        tangential=carried * hip_x + walker.m * (own_x + swing_x) - weight_x,
    )
    return RollingMotion(alpha_1, alpha_2, force)


@kept_alone
def rolling_field(t: Time, state: RigidState, scene: RigidScene) -> RigidState:
    """Time derivative of the state, in the form that `diffrax.ODETerm` takes.

    Args:
        t: time [s]; the field does not depend on it.
        state: leg 2 standing, leaves of any common shape, SI units.
        scene: the rigid walker.

    Returns:
        The rates of change [SI units per second], leaves shaped as the state's.
    """
    motion = rolling_rates(scene, state)
    _, cosine = sine_cosine(state.theta_2)
    walker = scene.walker
    return RigidState(
        hip_x=-(walker.r + walker.hip_to_foot * cosine) * state.omega_2,
        theta_1=state.omega_1,
        theta_2=state.omega_2,
        omega_1=motion.alpha_1,
        omega_2=motion.alpha_2,
    )


@field_of.register
def _(scene: RigidScene) -> VectorField:
    return rolling_field

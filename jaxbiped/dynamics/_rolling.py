"""Single support of the rigid walker: leg 2 rolls without slip, leg 1 swings."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._circular import sine_cosine
from jaxbiped._types import Scalar
from jaxbiped.dynamics._forces import FootForce
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._walker import Walker


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
        ratio = self.coupling / self.swing
        of_stance = (stance - ratio * swing) / (self.stance - ratio * self.coupling)
        return of_stance, swing / self.swing - ratio * of_stance


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


def rolling(scene: RigidScene, state: RigidState) -> RollingMotion:
    """Accelerations and reaction at a state; leaves shaped as the state's.

    Lagrange's equations of the two angles, with the accelerations of hip and centres of mass
    written out. By the sources' symbols: l − r is hip to foot centre, d hip to centre of mass.
    """
    walker, ground = scene.walker, scene.ground
    m, d, r = walker.m, walker.d, walker.r
    reach, below = walker.hip_to_foot, walker.hip_to_foot - d
    carried = walker.hip_mass + m
    stance = support_of(walker, state.theta_2)
    sine, cosine = sine_cosine(state.theta_1)
    g_x, g_z = ground.g * jnp.sin(ground.slope), -ground.g * jnp.cos(ground.slope)
    stance_square, swing_square = state.omega_2**2, state.omega_1**2
    # Centripetal accelerations: of the hip and of the centres of mass about what carries them.
    hip_x, hip_z = reach * stance.sine * stance_square, -reach * stance.cosine * stance_square
    own_x, own_z = below * stance.sine * stance_square, -below * stance.cosine * stance_square
    swing_x, swing_z = -d * sine * swing_square, d * cosine * swing_square
    inertia = inertia_of(walker, stance, sine, cosine)
    swing_torque = m * d * (cosine * (g_x - hip_x) + sine * (g_z - hip_z))
    # The part of the stance's centripetal acceleration along its own velocity: −r (…) sin θ.
    along = r * stance.sine * stance_square
    stance_torque = (
        m * (stance.mass_x * g_x + stance.mass_z * g_z + along * below)
        + carried * (stance.hip_x * g_x + stance.hip_z * g_z + along * reach)
        - m * (stance.hip_x * swing_x + stance.hip_z * swing_z)
    )
    alpha_2, alpha_1 = inertia.solved(stance_torque, swing_torque)
    hip_ax, hip_az = stance.hip_x * alpha_2 + hip_x, stance.hip_z * alpha_2 + hip_z
    own_ax, own_az = stance.mass_x * alpha_2 + own_x, stance.mass_z * alpha_2 + own_z
    swing_ax = d * cosine * alpha_1 + swing_x
    swing_az = d * sine * alpha_1 + swing_z
    total = walker.total_mass
    force = FootForce(
        normal=carried * hip_az + m * (own_az + swing_az) - total * g_z,
        tangential=carried * hip_ax + m * (own_ax + swing_ax) - total * g_x,
    )
    return RollingMotion(alpha_1, alpha_2, force)


def rolling_field(t: Any, state: RigidState, scene: RigidScene) -> RigidState:
    """Time derivative of the state, in the form that `diffrax.ODETerm` takes."""
    motion = rolling(scene, state)
    _, cosine = sine_cosine(state.theta_2)
    walker = scene.walker
    return RigidState(
        hip_x=-(walker.r + walker.hip_to_foot * cosine) * state.omega_2,
        theta_1=state.omega_1,
        theta_2=state.omega_2,
        omega_1=motion.alpha_1,
        omega_2=motion.alpha_2,
    )

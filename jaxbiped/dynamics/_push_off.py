"""Push-off of the rigid walker: what the trailing ankle's impulse does just before heel strike."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._cached_jit import kept_alone
from jaxbiped._circular import sine_cosine
from jaxbiped._types import Scalar
from jaxbiped.dynamics._actuation import actuators_of
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.dynamics._rolling import support_of
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene.actuation._foot_actuators import PushOff


class Impulse(NamedTuple):
    """An impulse on the hip in the slope's frame [N·s], leaves shaped as the state's."""

    x: Scalar
    z: Scalar


def push_off_impulse(scene: RigidScene, state: RigidState) -> Impulse | None:
    """The impulse on leg 2 just before the impact; None where the scene has no push-off.

    It acts along the leg, through the hip, so it turns no leg about the hip.
    """
    parts = actuators_of(scene, PushOff)
    if not parts:
        return None
    size = parts[0].impulse
    for part in parts[1:]:
        size = size + part.impulse
    sine, cosine = sine_cosine(state.theta_2)
    return Impulse(-size * sine, size * cosine)


@kept_alone
def push_off_work(scene: RigidScene, state: RigidState) -> Scalar:
    """Work of the push-off at a state just before the impact [J]; zero without one.

    The impulse times the mean of the hip's velocities along it, before and after. In between
    neither foot is held: the walker is free, and the legs follow the hip.

    Args:
        scene: the rigid walker.
        state: leg 2 standing, leaves of any common shape, SI units.

    Returns:
        The work [J], shaped as the state's leaves.
    """
    impulse = push_off_impulse(scene, state)
    if impulse is None:
        return jnp.zeros_like(state.theta_2)
    walker = scene.walker
    stance = support_of(walker, state.theta_2)
    hip_vx, hip_vz = stance.hip_x * state.omega_2, stance.hip_z * state.omega_2
    m_xx, m_xz, m_zz = walker.total_mass, jnp.zeros_like(hip_vx), walker.total_mass
    inertia = walker.J + walker.m * walker.d * walker.d
    for angle in (state.theta_1, state.theta_2):
        sine, cosine = sine_cosine(angle)
        coupling_x, coupling_z = walker.m * walker.d * cosine, walker.m * walker.d * sine
        m_xx = m_xx - coupling_x * coupling_x / inertia
        m_xz = m_xz - coupling_x * coupling_z / inertia
        m_zz = m_zz - coupling_z * coupling_z / inertia
    determinant = m_xx * m_zz - m_xz * m_xz
    gain_x = (m_zz * impulse.x - m_xz * impulse.z) / determinant
    gain_z = (m_xx * impulse.z - m_xz * impulse.x) / determinant
    return impulse.x * (hip_vx + 0.5 * gain_x) + impulse.z * (hip_vz + 0.5 * gain_z)

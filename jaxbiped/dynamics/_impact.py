"""Heel strike of the rigid walker: a plastic impact, and a push-off just before it."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._circular import sine_cosine
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.dynamics._actuation import actuators_of
from jaxbiped.dynamics._rolling import Support, inertia_of, support_of
from jaxbiped.dynamics._state import RigidState
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene.actuation._actuators import PushOff


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


class Impact(NamedTuple):
    """What an impact does.

    Attributes:
        state: afterwards, the legs' names exchanged: leg 2 is the one that came down.
        impulse_x, impulse_z: of the ground on the foot that came down [N·s].
        lifting: speed at which the foot that stood leaves the ground afterwards [m/s]. One below
            zero would have been held by the ground, and shared the impact.
    """

    state: RigidState
    impulse_x: Scalar
    impulse_z: Scalar
    lifting: Scalar


@kept_alone
def impact(scene: RigidScene, state: RigidState) -> Impact:
    """The plastic impact of leg 1's foot, leg 2's being released at once.

    The impulse acts where the new foot touches, so motions that roll about that point do not feel
    it: the momenta of the new support's two rates are kept. They are the angular momenta of the
    whole walker about the new point of contact and of the leg that leaves about the hip. A push-off
    comes at once before: its impulse along the leg that leaves adds to the first of them.

    Args:
        scene: the rigid walker.
        state: just before the impact, leg 2 standing, SI units.

    Returns:
        The state just after it, legs exchanged, and the impulse [N·s], leaves shaped as the
        state's.
    """
    walker = scene.walker
    m, d = walker.m, walker.d
    old, new = support_of(walker, state.theta_2), support_of(walker, state.theta_1)
    hip = (old.hip_x * state.omega_2, old.hip_z * state.omega_2)
    leaving = (old.mass_x * state.omega_2, old.mass_z * state.omega_2)
    landing = (
        hip[0] + d * new.cosine * state.omega_1,
        hip[1] + d * new.sine * state.omega_1,
    )

    def along(velocity: tuple[Scalar, Scalar], x: Scalar, z: Scalar) -> Scalar:
        return velocity[0] * x + velocity[1] * z

    stance_momentum = (
        m * along(landing, new.mass_x, new.mass_z)
        + walker.hip_mass * along(hip, new.hip_x, new.hip_z)
        + m * along(leaving, new.hip_x, new.hip_z)
        + walker.J * state.omega_1
    )
    swing_momentum = m * d * along(leaving, old.cosine, old.sine) + walker.J * state.omega_2
    push_off = push_off_impulse(scene, state)
    if push_off is not None:
        stance_momentum = stance_momentum + along(push_off, new.hip_x, new.hip_z)
    inertia = inertia_of(walker, new, old.sine, old.cosine)
    stance_rate, swing_rate = inertia.solved(stance_momentum, swing_momentum)
    after = RigidState(state.hip_x, state.theta_2, state.theta_1, swing_rate, stance_rate)
    before_x, before_z = (
        walker.hip_mass * hip[i] + m * (leaving[i] + landing[i]) for i in range(2)
    )
    if push_off is not None:
        before_x, before_z = before_x + push_off.x, before_z + push_off.z
    after_x, after_z = _momentum(scene, after, new)
    lifting = (new.hip_z * stance_rate) + walker.hip_to_foot * old.sine * swing_rate
    return Impact(after, after_x - before_x, after_z - before_z, lifting)


def _momentum(scene: RigidScene, state: RigidState, stance: Support) -> tuple[Scalar, Scalar]:
    """Momentum of the whole walker that rolls on leg 2 [kg·m/s]."""
    walker = scene.walker
    sine, cosine = sine_cosine(state.theta_1)
    carried = walker.hip_mass + walker.m
    return (
        (carried * stance.hip_x + walker.m * stance.mass_x) * state.omega_2
        + walker.m * walker.d * cosine * state.omega_1,
        (carried * stance.hip_z + walker.m * stance.mass_z) * state.omega_2
        + walker.m * walker.d * sine * state.omega_1,
    )

"""Equations of motion in minimal coordinates: hip x, hip z and two leg angles."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar, Time, VectorField
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.dynamics._actuation import hip_torques
from jaxbiped.dynamics._contacts import feet, foot_force, hip_motion
from jaxbiped.dynamics._redundant_state import CompliantState
from jaxbiped.dynamics._state import State, field_of
from jaxbiped.dynamics._tree import Motion, point_motion, pose_of, times
from jaxbiped.dynamics._tree_inertia import centrifugal_loads, composites, eliminate, substitute
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


@kept_alone
def accelerations(scene: Scene, state: State) -> Accelerations:
    """Accelerations at a state; leaves shaped as the state's.

    Args:
        scene: the walker on its ground.
        state: leaves of any common shape, SI units.

    Returns:
        Hip [m/s²] and legs [rad/s²], leaves shaped as the state's.
    """
    mechanism, ground, both = scene.walker.mechanism(), scene.ground, feet(scene, state)
    structure = mechanism.structure
    angles, rates = (state.theta_1, state.theta_2), (state.omega_1, state.omega_2)
    motion = Motion(state.hip_x, state.hip_z, state.hip_vx, state.hip_vz, angles, rates)
    pose, known = pose_of(mechanism, motion), composites(mechanism)
    loads = centrifugal_loads(structure, known, pose)
    for body, foot, found in zip(structure.feet, mechanism.feet, both, strict=True):
        # Where it is known that a foot never touches, nothing of its contact is in the program.
        if found.admitted is not False:
            reaction = foot_force(scene, found)
            point = point_motion(structure, pose, body, foot.centre)
            loads = loads.with_force(point, reaction.tangential, reaction.normal)
            loads = loads.with_torques(((body, 1.0),), times(reaction.tangential, foot.radius))
    torques = None
    if scene.actuation is not None:
        torques = hip_torques(scene, hip_motion(scene, both, angles, rates))
    for body, torque in enumerate(torques or ()):
        loads = loads.with_torques(((body, 1.0),), torque)
    moved = substitute(structure, eliminate(structure, known, pose), loads)
    downhill, weight = ground.g * jnp.sin(ground.slope), ground.g * jnp.cos(ground.slope)
    return Accelerations(moved[0] + downhill, moved[1] - weight, moved[2], moved[3])


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

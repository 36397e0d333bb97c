"""Equations of motion in redundant coordinates: each body by itself, held by constraints."""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.compiler import kept_alone
from jaxbiped.constraints._linkage import row_times, torque_on, turn_of
from jaxbiped.dynamics._constrained_motion import (
    LinkageMotion,
    coordinates_of,
    motion_under,
    with_coordinates,
)
from jaxbiped.dynamics._contacts import bristles_of, feet, feet_at, foot_force
from jaxbiped.dynamics._equivalent_states import BodiesState, poses_of
from jaxbiped.dynamics._footfalls import mean
from jaxbiped.dynamics._joint_loads import of_all_bodies
from jaxbiped.dynamics._minimal_motion import accelerations, bristle_rates, with_torques
from jaxbiped.dynamics._tree import (
    Arm,
    Loads,
    PointMotion,
    Pose,
    Vector,
    arm_of,
    point_acceleration,
    point_motion,
)
from jaxbiped.linalg._sparse_lu import times
from jaxbiped.scene._bodies import Point
from jaxbiped.scene._ground import gravity_on
from jaxbiped.scene._linkages import loaded_bodies
from jaxbiped.scene._scene import CompliantScene, RedundantScene
from jaxbiped.scene._state_types import state_type_of


class HipForce(NamedTuple):
    """Force of the root point's hinge on the first body, leaves shaped as the state's.

    The force on the other bodies there is the opposite, except for the share of the root point's
    mass.

    Attributes:
        x: component along the slope, downhill positive [N].
        z: component along the slope's outward normal [N].
    """

    x: Scalar
    z: Scalar


class RedundantMotion(NamedTuple):
    """Motion of a redundant walker at a state, leaves shaped as the state's.

    Attributes:
        accelerations: accelerations of the coordinates in the state's order [m/s², rad/s², 1/s²].
        hip_force: force of the root point's hinge on the first body [N].
        minimal: the same motion in minimal coordinates; the root point is midway between its
            positions on the bodies that hang on it.
    """

    accelerations: list[Scalar]
    hip_force: HipForce
    minimal: Any


@kept_alone
def redundant_motion(scene: RedundantScene, state: BodiesState) -> RedundantMotion:
    """Accelerations and the reaction at the root point, with the scene's constraint method.

    Args:
        scene: the walker and its constraint method.
        state: redundant, leaves of any common shape, SI units.

    Returns:
        Accelerations [m/s², rad/s²] and force on the first body [N], leaves shaped as the state's.
    """
    structure, root_mass = scene.mechanism.structure, scene.mechanism.root_mass
    moved = _linkage_motion(scene, state)
    minimal, (ax, az) = _minimal_accelerations(scene, state, moved.accelerations)
    forces = [
        force for force, j in zip(moved.joint_forces, structure.parents[1:], strict=True) if j < 0
    ]
    nothing = (jnp.zeros_like(ax),) * 2
    force_x, force_z = (sum(each[1:], each[0]) for each in zip(*(forces or [nothing]), strict=True))
    if root_mass is not None:
        share, (downhill, weight) = root_mass / (len(forces) + 1), gravity_on(scene.ground)
        force_x, force_z = force_x - share * (ax - downhill), force_z - share * (az + weight)
    return RedundantMotion(moved.accelerations, HipForce(force_x, force_z), minimal)


@kept_alone
def redundant_field(t: Time, state: BodiesState, scene: RedundantScene) -> BodiesState:
    """Time derivative of a redundant state, in the form that `diffrax.ODETerm` takes.

    Args:
        t: time [s]; the field does not depend on it.
        state: redundant, leaves of any common shape, SI units.
        scene: the walker and its constraint method.

    Returns:
        The rates of change [SI units per second], a state of the same kind and shape.
    """
    _, v = coordinates_of(scene, state)
    moved = with_coordinates(state, v, _linkage_motion(scene, state).accelerations)
    return moved._replace(**bristle_rates(scene, state))


def _linkage_motion(scene: RedundantScene, state: BodiesState) -> LinkageMotion:
    q, v = coordinates_of(scene, state)
    poses, linkage = poses_of(scene, state), scene.linkage
    circular = list(zip(poses[0].sines, poses[0].cosines, strict=True))
    applied = _applied_forces(scene, state, poses)
    return motion_under(linkage, scene.method, q, v, applied, circular)


def _applied_forces(
    scene: RedundantScene, state: BodiesState, poses: tuple[Pose, ...]
) -> list[Scalar]:
    """Forces of gravity, ground, joint parts and actuators on each body by its own coordinates."""
    mechanism, linkage = scene.mechanism, scene.linkage
    found = feet_at(scene, poses, bristles_of(scene, state))
    torques = with_torques(Loads.none(mechanism.structure), scene, poses, found).torques
    downhill, weight = gravity_on(scene.ground)
    applied: list[Scalar] = []
    for j, body in enumerate(loaded_bodies(mechanism)):
        loads = Loads(body.mass * downhill, -(body.mass * weight), torques)
        for k, foot in enumerate(mechanism.feet):
            if mechanism.structure.feet[k] == j and found[k].admitted is not False:
                reaction = foot_force(scene, found[k])
                point = _from_centre(poses[j], j, foot.centre, body.centre)
                loads = loads.with_force(point, reaction.tangential, reaction.normal)
                loads = loads.with_torques(((j, 1.0),), times(reaction.tangential, foot.radius))
        own, on_body = state[linkage.coordinates * j :], (loads.x, loads.z, loads.torques[j])
        *force, torque = (jnp.zeros_like(own[0]) if each is None else each for each in on_body)
        applied += [*force, *torque_on(linkage, own, torque)]
    return applied


def _from_centre(pose: Pose, body: int, place: Point, centre: Point) -> PointMotion:
    """A point of a body from the body's mass centre, about which it turns by itself."""
    at, own = (
        arm_of(p.along, p.ahead, pose.sines[body], pose.cosines[body]) for p in (place, centre)
    )
    arm, rate = Arm(at.dx - own.dx, at.dz - own.dz), pose.motion.rates[body]
    return PointMotion(arm.dz, -arm.dx, arm.dx * rate, arm.dz * rate, ((body, arm),))


def _minimal_accelerations(
    scene: RedundantScene, state: BodiesState, second: list[Scalar]
) -> tuple[Any, Vector]:
    """Accelerations in minimal coordinates, and of the root point as the first body has it."""
    mechanism, linkage, poses = scene.mechanism, scene.linkage, poses_of(scene, state)
    structure, bodies = mechanism.structure, loaded_bodies(mechanism)
    q, v = coordinates_of(scene, state)
    turns = [turn_of(linkage, q, v, j) for j in range(len(bodies))]
    turning = [row_times(turn.row, second) + turn.convective for turn in turns]
    roots = []
    for j in structure.children[-1]:
        centre = point_motion(structure, poses[j], j, bodies[j].centre)
        own = point_acceleration(centre, poses[j].motion.rates, turning)
        first = linkage.coordinates * j
        roots.append((second[first] - own[0], second[first + 1] - own[1]))
    root = (mean(values) for values in zip(*roots, strict=True))
    kind = state_type_of(structure.accelerations)
    return kind(*root, *(turning[j] for j in structure.free)), roots[0]


@kept_alone
def hip_force(scene: CompliantScene, state: PyTree) -> HipForce:
    """The reaction of the root point's hinge on the first body, in either formulation.

    In minimal coordinates, it does no work and does not occur in the equations. It is the remainder
    of Newton's law for the first body with everything that hangs on it: m (a − g) minus the
    ground's force.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: of the scene's kind, leaves of any common shape, SI units.

    Returns:
        The force [N], leaves shaped as the state's.
    """
    if isinstance(scene, RedundantScene):
        return redundant_motion(scene, state).hip_force
    mechanism, pose = scene.mechanism, poses_of(scene, state)[0]
    structure, second = mechanism.structure, accelerations(scene, state)
    turning = of_all_bodies(structure, second[2:], second[0])
    downhill, weight = gravity_on(scene.ground)
    force_x = force_z = jnp.zeros_like(state[0])
    for j, body in enumerate(mechanism.bodies):
        if structure.chains[j][0] == 0:
            centre = point_motion(structure, pose, j, body.centre)
            ax, az = point_acceleration(centre, pose.motion.rates, turning)
            force_x = force_x + body.mass * (ax + second[0] - downhill)
            force_z = force_z + body.mass * (az + second[1] + weight)
    for j, foot in zip(structure.feet, feet(scene, state), strict=True):
        if structure.chains[j][0] == 0:
            reaction = foot_force(scene, foot)
            force_z = force_z - reaction.normal
            if reaction.tangential is not None:
                force_x = force_x - reaction.tangential
    return HipForce(force_x, force_z)

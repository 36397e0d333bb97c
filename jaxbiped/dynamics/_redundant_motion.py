"""Equations of motion in redundant coordinates: each body by itself, held by constraints."""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar, Time, VectorField
from jaxbiped.compiler import kept_alone
from jaxbiped.constraints._linkage_constraints import (
    constraints_of,
    headings_of,
    row_times,
    torque_on,
    turn_of,
)
from jaxbiped.dynamics._contacts import bristles_of, feet_at, foot_force
from jaxbiped.dynamics._equivalent_states import BodiesState, poses_of
from jaxbiped.dynamics._footfalls import mean
from jaxbiped.dynamics._implicit_field import AbstractImplicitField, Residual
from jaxbiped.dynamics._linkage_motion import LinkageMotion, motion_under
from jaxbiped.dynamics._minimal_motion import bristle_rates, with_torques
from jaxbiped.dynamics._state import field_of
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
from jaxbiped.linalg._sparse_lu import SparseMatrix, times
from jaxbiped.scene._bodies import Point
from jaxbiped.scene._ground import gravity_on
from jaxbiped.scene._linkages import loaded_bodies
from jaxbiped.scene._scene import RedundantScene
from jaxbiped.scene._state_types import state_type_of
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw


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


class Violation(NamedTuple):
    """Violation of the constraints by a redundant state, leaves shaped as the state's.

    Attributes:
        position: largest distance between the positions of a hinge on its two bodies [m].
        rate: largest relative speed of these positions [m/s].
        normalisation: largest | cos² + sin² − 1 | of a body's Euler parameters; 0 without them.
        angle: largest violation of a coupling [rad]; 0 without couplings.
        angle_rate: largest rate of such a violation [rad/s].
    """

    position: RealScalarLike
    rate: RealScalarLike
    normalisation: RealScalarLike
    angle: RealScalarLike = 0.0
    angle_rate: RealScalarLike = 0.0


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


def coordinates_of(scene: RedundantScene, state: BodiesState) -> tuple[list[Scalar], list[Scalar]]:
    """Coordinates and rates of a redundant state as the linkage has them."""
    count = len(scene.mechanism.structure.bodies) * scene.linkage.coordinates
    return list(state[:count]), list(state[count : 2 * count])


def with_coordinates(state: PyTree, q: list[Scalar], v: list[Scalar]) -> BodiesState:
    """The state with other coordinates and rates; bristles stay."""
    return type(state)(*q, *v, *state[len(q) + len(v) :])


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
    moved = _linkage_motion(scene, state)
    memory = {}
    if isinstance(scene.friction, AbstractBristleLaw):
        memory = bristle_rates(scene.friction, scene, state)
    return with_coordinates(state, v, moved.accelerations)._replace(**memory)


class BodiesField(AbstractImplicitField):
    """`redundant_field`, whose implicit form is its own: forces of constraints reach every body."""

    def __call__(self, t: Time, y: BodiesState, args: RedundantScene) -> BodiesState:
        return redundant_field(t, y, args)

    def mass_matrix(self, y: BodiesState, args: RedundantScene) -> SparseMatrix:
        return {}

    def residual(self, y: BodiesState, rates: BodiesState, args: RedundantScene) -> Residual:
        found = redundant_field(jnp.zeros(()), y, args)
        return {i: a - b for i, (a, b) in enumerate(zip(found, rates, strict=True))}


@field_of.register
def _(scene: RedundantScene) -> VectorField:
    return BodiesField()


@kept_alone
def violation(scene: RedundantScene, state: BodiesState) -> Violation:
    """Violations of hinges and couplings, and their rates of change.

    Args:
        scene: the walker and its constraint method.
        state: redundant, leaves of any common shape, SI units.

    Returns:
        Distance [m], relative speed [m/s], normalisation [–], angle [rad] and its rate [rad/s],
        leaves shaped as the state's.
    """
    linkage = scene.linkage
    at = constraints_of(linkage, *coordinates_of(scene, state))
    points = 2 * len(linkage.joints)
    angles = points + len(linkage.angles)

    def most(values: Sequence[Scalar]) -> Scalar:
        return functools.reduce(jnp.maximum, map(jnp.abs, values), jnp.zeros_like(state[0]))

    def apart(values: Sequence[Scalar]) -> Scalar:
        return most([jnp.hypot(*values[i : i + 2]) for i in range(0, points, 2)])

    return Violation(
        position=apart(at.violation),
        rate=apart(at.rate),
        normalisation=most(at.violation[angles:]),
        angle=most(at.violation[points:angles]),
        angle_rate=most(at.rate[points:angles]),
    )


def _linkage_motion(scene: RedundantScene, state: BodiesState) -> LinkageMotion:
    q, v = coordinates_of(scene, state)
    poses, linkage = poses_of(scene, state), scene.linkage
    circular = list(zip(poses[0].sines, poses[0].cosines, strict=True))
    headings = headings_of(linkage, q, v, circular)
    applied = _applied_forces(scene, state, poses)
    return motion_under(linkage, scene.method, q, v, applied, headings)


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

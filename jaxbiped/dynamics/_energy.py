"""Energies of the walker and the powers that change them: gravity's, contacts', actuators'."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias, TypeVar, cast

import jax.numpy as jnp

from jaxbiped._checks import check_type
from jaxbiped._types import Scalar
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._actuation import (
    Carriers,
    hip_actuators,
    load_shares,
    motor_torques,
    preload,
)
from jaxbiped.dynamics._contacts import (
    feet,
    foot_force,
    hip_motion,
    leg_loads,
    legs_at,
    normal_forces,
)
from jaxbiped.dynamics._equivalent_states import motion_in, poses_of, whole_state
from jaxbiped.dynamics._footfalls import FootMotion, LegMotion, touches
from jaxbiped.dynamics._joint_loads import JointEnergy, joint_energy
from jaxbiped.dynamics._stance import Stance, of_stance
from jaxbiped.dynamics._stance_motion import carriers_of, hip_motion_of
from jaxbiped.dynamics._tree import Motion, PointMotion, point_motion
from jaxbiped.linalg._sparse_lu import product
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._motor_motion import angle_value
from jaxbiped.scene._scene import AbstractWalkerScene, CompliantScene
from jaxbiped.scene._state_types import check_scalars
from jaxbiped.scene.actuation._actuators import HipMotion, LegTorques


class Energies(NamedTuple):
    """Energies at a state [J].

    Attributes:
        kinetic: kinetic energy of all bodies and the root point.
        gravitational: potential energy of gravity, zero if all mass is at the origin of the slope's
            frame.
        elastic: energy stored in compliant feet that touch, and in springs, stops and latches.
    """

    kinetic: Scalar
    gravitational: Scalar
    elastic: Scalar

    @property
    def total(self) -> Scalar:
        """Sum of the three [J]."""
        return self.kinetic + self.gravitational + self.elastic


class Powers(NamedTuple):
    """Powers at a state [W].

    Attributes:
        gravity: power of gravity on the walker.
        indentation: power of the walker against the ground's normal reaction, F_N δ̇, summed over
            all feet that are compliant, and against springs, stops and latches.
        damper: the part of `indentation` that is lost and not stored; for a foot that touches,
            (F_N − elastic force) δ̇.
        friction: power lost to friction, never negative.
        actuation: power of motors and actuators, including springs and dampers between the legs;
            None for a passive walker.
        motors: power of each motor: one for each actuator at the hip that has a motor, one for each
            foot that has a preload, and one for each motor at a joint; None for a passive walker.
    """

    gravity: Scalar
    indentation: Scalar
    damper: Scalar
    friction: Scalar
    actuation: Scalar | None = None
    motors: tuple[Scalar, ...] | None = None


_Driving: TypeAlias = tuple[Scalar, tuple[Scalar, ...]]
"""The last two of `Powers`."""
_Told = TypeVar("_Told")


@kept_alone
def energies(scene: AbstractWalkerScene, state: Any) -> Energies:
    """Kinetic, gravitational and elastic energy; leaves shaped as the state's.

    Args:
        scene: the walker on its ground, on compliant or on rigid feet.
        state: of the scene's kind, leaves of any common shape, SI units.

    Returns:
        The three energies [J], leaves shaped as the state's.

    Raises:
        ArgumentError: the state is another scene's.
    """
    check_type("scene", scene, AbstractWalkerScene)
    laws: Any = scene
    ground, whole = scene.ground, _placed(scene, state)
    kinetic = elastic = moment_x = moment_z = jnp.zeros_like(state[0])
    for mass, point in _mass_points(scene, whole):
        kinetic = kinetic + 0.5 * mass * (point.vx**2 + point.vz**2)
        moment_x, moment_z = moment_x + mass * point.x, moment_z + mass * point.z
    bodies = zip(scene.mechanism.bodies, poses_of(scene, whole), strict=True)
    for j, (body, pose) in enumerate(bodies):
        kinetic = kinetic + 0.5 * body.inertia * pose.motion.rates[j] ** 2
    moment = moment_z * jnp.cos(ground.slope) - moment_x * jnp.sin(ground.slope)
    for foot in _feet(scene, state):
        stored = laws.normal.elastic_energy(foot.penetration)
        elastic = elastic + jnp.where(touches(foot), stored, 0.0)
    joints = _joint_energy(scene, whole)
    if joints is not None:
        elastic = elastic + joints.stored
    return Energies(kinetic, ground.g * moment, elastic)


def _placed(scene: Any, state: Any) -> Any:
    """Gives a state that has the place of the root point, which follows from a rigid walker's."""
    if scene.compliant:
        return state
    check_scalars(state, scene.state_names)
    return whole_state(scene, state)


def _feet(scene: AbstractWalkerScene, state: Any) -> tuple[FootMotion, ...]:
    """Gives the feet that press into the ground: none of a walker on rigid feet."""
    return feet(cast("CompliantScene", scene), state) if scene.compliant else ()


def _mass_points(scene: AbstractWalkerScene, state: Any) -> list[tuple[Scalar, PointMotion]]:
    """Mass and motion of each body's centre of mass, and of the root point where it has a mass."""
    mechanism, poses = scene.mechanism, poses_of(scene, state)
    points = [
        (body.mass, point_motion(mechanism.structure, pose, j, body.centre))
        for j, (body, pose) in enumerate(zip(mechanism.bodies, poses, strict=True))
    ]
    if mechanism.root_mass is not None:
        root = motion_in(scene, state)
        at = PointMotion(root.x, root.z, root.vx, root.vz, ())
        points.append((mechanism.root_mass, at))
    return points


def _joint_energy(scene: AbstractWalkerScene, state: Any) -> JointEnergy | None:
    motion = motion_in(scene, state)
    return joint_energy(scene.mechanism, motion, scene.ground.slope, stops=scene.compliant)


@kept_alone
def powers(scene: AbstractWalkerScene, state: Any) -> Powers:
    """Power of gravity, contacts, joints and of all that drives; leaves shaped as the state's.

    Args:
        scene: the walker on its ground, on compliant or on rigid feet.
        state: of the scene's kind, leaves of any common shape, SI units.

    Returns:
        The powers [W], leaves shaped as the state's. On rigid feet they are those of the motion
        between impacts.

    Raises:
        ArgumentError: the state is another scene's.
    """
    check_type("scene", scene, AbstractWalkerScene)
    laws: Any = scene
    ground, whole = scene.ground, _placed(scene, state)
    indentation = damper = friction = momentum_x = momentum_z = jnp.zeros_like(state[0])
    for mass, point in _mass_points(scene, whole):
        momentum_x, momentum_z = momentum_x + mass * point.vx, momentum_z + mass * point.vz
    gravity = ground.g * (jnp.sin(ground.slope) * momentum_x - jnp.cos(ground.slope) * momentum_z)
    for foot in _feet(scene, state):
        force = foot_force(laws, foot)
        held = jnp.where(touches(foot), laws.normal.elastic_force(foot.penetration), 0.0)
        indentation = indentation + force.normal * foot.penetration_rate
        damper = damper + (force.normal - held) * foot.penetration_rate
        if force.tangential is not None:
            friction = friction - force.tangential * foot.slip_speed
    joints = _joint_energy(scene, whole)
    if joints is not None:
        indentation, damper = indentation + joints.taken, damper + joints.lost
    if not is_driven(scene):
        return Powers(gravity, indentation, damper, friction)
    return Powers(gravity, indentation, damper, friction, *_actuator_powers(scene, state))


def is_driven(scene: AbstractWalkerScene) -> bool:
    """Whether anything but gravity may drive a walker: an actuator, or a motor at a joint."""
    return scene.mechanism.has_motors or getattr(scene, "actuation", None) is not None


def _actuator_powers(scene: Any, state: Any) -> _Driving:
    return in_driven_motion(scene, state, functools.partial(_driving, scene))


def in_driven_motion(scene: Any, state: Any, function: Callable[..., _Told]) -> _Told:
    """Calls a function of what actuators know, on feet of either kind.

    It takes the motion of all bodies, the carriers, a function that returns the hip's motion, and
    the powers of the feet's preloads [W].
    """
    if not scene.compliant:

        def standing(stance: Stance) -> _Told:
            hip = functools.partial(hip_motion_of, stance)
            return function(stance.pose.motion, carriers_of(stance), hip, ())

        return of_stance(scene, state, standing)
    structure = scene.mechanism.structure
    motion, contacts = poses_of(scene, state)[0].motion, feet(scene, state)
    legs, forces = legs_at(scene, state), normal_forces(scene, contacts)
    shares, pressing = leg_loads(structure, load_shares(scene, forces)), []
    for force, leg in zip(forces, structure.leg_of_foot, strict=True):
        moved = preload(scene, legs[leg])
        if moved is not None and force is not None:
            pressing.append(force * moved[1])
    hip = functools.partial(hip_motion, scene, contacts, motion)
    return function(motion, (legs, shares), hip, pressing)


def _driving(
    scene: Any,
    motion: Motion,
    carriers: Carriers,
    hip: Callable[[], HipMotion],
    pressing: Sequence[Scalar],
) -> _Driving:
    """Computes the powers of all that drives a walker on feet of either kind.

    `hip` is called only where there are actuators at the hip; `pressing` are the powers of the
    feet's preloads [W].
    """
    total, motors = jnp.zeros_like(motion.x), list(pressing)
    parts = hip_actuators(scene)
    if parts:
        now = hip()
        turning = (part.motor_torques(now) for part in parts)
        motors = [_power(torques, now) for torques in turning if torques is not None] + motors
        total = sum((_power(part.torques(now), now) for part in parts), total)
    joints = motor_powers(scene.mechanism, motion, scene.ground.slope, *carriers)
    return sum((*pressing, *joints), total), (*motors, *joints)


def _power(torques: LegTorques, hip: HipMotion) -> Scalar:
    return torques[0] * hip.rate[0] + torques[1] * hip.rate[1]


def kinetic_energy(scene: AbstractWalkerScene, state: Any) -> Scalar:
    """Kinetic energy of a rigid walker in a state [J]."""

    def energy(stance: Stance) -> Scalar:
        motion = stance.pose.motion
        rates = dict(enumerate((motion.vx, motion.vz, *motion.rates)))
        momenta: Any = product(stance.mass_matrix(), rates)
        others = (rates[i] * momenta[i] for i in range(1, len(rates)))
        return 0.5 * sum(others, rates[0] * momenta[0])

    return of_stance(scene, state, energy)


def motor_powers(
    mechanism: Mechanism,
    motion: Motion,
    slope: Scalar,
    legs: Sequence[LegMotion],
    shares: Sequence[Scalar | None],
) -> tuple[Scalar, ...]:
    """Power of each motor on the walker [W]; see `motor_torques`."""
    found: dict[int, Scalar] = {}
    for number, angle, torque in motor_torques(mechanism, motion, slope, legs, shares):
        power = torque * angle_value(angle, motion.rates, None)
        found[number] = found[number] + power if number in found else power
    return tuple(found.values())

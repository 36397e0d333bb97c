"""Energies of the walker and the powers that change them: gravity's, contacts', actuators'."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._actuation import (
    WalkerScene,
    hip_actuators,
    hip_torques,
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
from jaxbiped.dynamics._equivalent_states import motion_in, poses_of
from jaxbiped.dynamics._footfalls import LegMotion, touches
from jaxbiped.dynamics._joint_loads import JointEnergy, joint_energy
from jaxbiped.dynamics._stance import Stance, of_stance
from jaxbiped.dynamics._tree import Motion, PointMotion, point_motion
from jaxbiped.linalg._sparse_lu import product
from jaxbiped.scene._abstract_scene import AbstractWalkerScene
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._motor_motion import angle_value
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._state_types import State
from jaxbiped.scene.actuation._abstract_actuator import HipMotion, LegTorques


class Energies(NamedTuple):
    """Energies at a state [J].

    Attributes:
        kinetic: kinetic energy of all bodies and the root point.
        gravitational: potential energy of gravity, zero if all mass is at the origin of the slope's
            frame.
        elastic: energy stored in the feet that touch, and in springs, stops and latches.
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
            all feet, and against springs, stops and latches.
        damper: the part of `indentation` that is lost and not stored; for a foot that touches,
            (F_N − elastic force) δ̇.
        friction: power lost to friction, never negative.
        actuation: power of the actuators, including springs and dampers between the legs; None for
            a passive walker.
        motors: power of each motor, as in `ActuatorPowers`; None for a passive walker.
    """

    gravity: Scalar
    indentation: Scalar
    damper: Scalar
    friction: Scalar
    actuation: Scalar | None = None
    motors: tuple[Scalar, ...] | None = None


class ActuatorPowers(NamedTuple):
    """Powers of a scene's actuators, leaves shaped as the state's.

    Attributes:
        total: power of all torques and set points on the walker, including springs and dampers [W].
        motors: power of each motor [W]: one for each actuator at the hip that has a motor, then
            one for each foot.
    """

    total: Scalar
    motors: tuple[Scalar, ...]


@kept_alone
def energies(scene: Scene, state: State) -> Energies:
    """Kinetic, gravitational and elastic energy; leaves shaped as the state's.

    Args:
        scene: the walker on its ground.
        state: leaves of any common shape, SI units.

    Returns:
        The three energies [J], leaves shaped as the state's.
    """
    kinetic, moment = kinetic_and_moment(scene, state)
    elastic = sum(
        jnp.where(touches(foot), scene.normal.elastic_energy(foot.penetration), 0.0)
        for foot in feet(scene, state)
    )
    joints = _joint_energy(scene, state)
    if joints is not None:
        elastic = elastic + joints.stored
    return Energies(kinetic, scene.ground.g * moment, jnp.asarray(elastic))


def kinetic_and_moment(scene: AbstractWalkerScene, state: State) -> tuple[Scalar, Scalar]:
    """Kinetic energy [J] and mass times height [kg·m] of a walker of any kind."""
    ground = scene.ground
    kinetic = moment_x = moment_z = jnp.zeros_like(state[0])
    for mass, point in _mass_points(scene, state):
        kinetic = kinetic + 0.5 * mass * (point.vx**2 + point.vz**2)
        moment_x, moment_z = moment_x + mass * point.x, moment_z + mass * point.z
    bodies = zip(scene.mechanism.bodies, poses_of(scene, state), strict=True)
    for j, (body, pose) in enumerate(bodies):
        kinetic = kinetic + 0.5 * body.inertia * pose.motion.rates[j] ** 2
    height = moment_z * jnp.cos(ground.slope) - moment_x * jnp.sin(ground.slope)
    return kinetic, height


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


def _joint_energy(scene: Scene, state: Any) -> JointEnergy | None:
    motion = motion_in(scene, state)
    return joint_energy(scene.mechanism, motion, scene.ground.slope, stops=scene.compliant)


@kept_alone
def powers(scene: Scene, state: State) -> Powers:
    """Power of gravity and the contact's powers; leaves shaped as the state's.

    Args:
        scene: the walker on its ground.
        state: leaves of any common shape, SI units.

    Returns:
        The powers [W], leaves shaped as the state's.
    """
    ground = scene.ground
    indentation = damper = friction = momentum_x = momentum_z = jnp.zeros_like(state[0])
    for mass, point in _mass_points(scene, state):
        momentum_x, momentum_z = momentum_x + mass * point.vx, momentum_z + mass * point.vz
    gravity = ground.g * (jnp.sin(ground.slope) * momentum_x - jnp.cos(ground.slope) * momentum_z)
    for foot in feet(scene, state):
        force = foot_force(scene, foot)
        held = jnp.where(touches(foot), scene.normal.elastic_force(foot.penetration), 0.0)
        indentation = indentation + force.normal * foot.penetration_rate
        damper = damper + (force.normal - held) * foot.penetration_rate
        if force.tangential is not None:
            friction = friction - force.tangential * foot.slip_speed
    joints = _joint_energy(scene, state)
    if joints is not None:
        indentation, damper = indentation + joints.taken, damper + joints.lost
    if not is_driven(scene):
        return Powers(gravity, indentation, damper, friction)
    actuators = _actuator_powers(scene, state)
    return Powers(gravity, indentation, damper, friction, actuators.total, actuators.motors)


def is_driven(scene: AbstractWalkerScene) -> bool:
    """Whether anything but gravity may drive a walker: an actuator, or a motor at a joint."""
    return scene.mechanism.has_motors or getattr(scene, "actuation", None) is not None


def _actuator_powers(scene: Scene, state: State) -> ActuatorPowers:
    motion, found = poses_of(scene, state)[0].motion, feet(scene, state)
    hip = None
    if scene.mechanism.structure.pairs:
        hip = hip_motion(scene, found, motion.angles, motion.rates)
    legs, forces = legs_at(scene, state), normal_forces(scene, found)
    shares = leg_loads(scene.mechanism.structure, load_shares(scene, forces))
    of_feet = (legs[leg] for leg in scene.mechanism.structure.leg_of_foot)
    of_parts = actuator_powers(scene, hip, list(zip(forces, of_feet, strict=True)))
    told = motor_powers(scene.mechanism, motion, scene.ground.slope, legs, shares)
    return ActuatorPowers(sum(told, of_parts.total), of_parts.motors + tuple(told))


def kinetic_energy(scene: AbstractWalkerScene, state: Any) -> Scalar:
    """Kinetic energy of a rigid walker in a state [J]."""

    def energy(stance: Stance) -> Scalar:
        motion = stance.pose.motion
        rates = dict(enumerate((motion.vx, motion.vz, *motion.rates)))
        momenta: Any = product(stance.mass_matrix(), rates)
        others = (rates[i] * momenta[i] for i in range(1, len(rates)))
        found: Scalar = 0.5 * sum(others, rates[0] * momenta[0])
        return found

    return of_stance(scene, state, energy)


def actuator_powers(
    scene: WalkerScene,
    hip: HipMotion | None,
    feet: Sequence[tuple[Scalar | None, LegMotion]] = (),
) -> ActuatorPowers:
    """Powers of the actuators of a walker that moves like this.

    Args:
        scene: what moves.
        hip: what actuators at the hip know; None where the walker has no pair of legs.
        feet: normal force on each foot [N] and how its leg moves; none of rigid feet.
    """
    total = jnp.zeros_like(feet[0][1].rate if hip is None else hip.angle[0])
    motors: list[Scalar] = []
    if hip is not None:
        torques = hip_torques(scene, hip)
        if torques is not None:
            total = total + _power(torques, hip)
        driven = (part.motor_torques(hip) for part in hip_actuators(scene))
        motors += [_power(each, hip) for each in driven if each is not None]
    for force, leg in feet:
        moved = preload(scene, leg)
        if moved is not None and force is not None:
            motors.append(force * moved[1])
            total = total + motors[-1]
    return ActuatorPowers(total, tuple(motors))


def _power(torques: LegTorques, hip: HipMotion) -> Scalar:
    return torques[0] * hip.rate[0] + torques[1] * hip.rate[1]


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

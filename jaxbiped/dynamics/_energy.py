"""Energies of the walker and the powers that change them."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.dynamics._actuation import ActuatorPowers, actuator_powers
from jaxbiped.dynamics._contacts import Foot, feet, foot_force, hip_motion, normal_forces, touches
from jaxbiped.dynamics._redundant_state import legs_of, minimal_state
from jaxbiped.dynamics._state import State
from jaxbiped.scene._scene import AbstractWalkerScene, Scene


class Energies(NamedTuple):
    """Energies at a state [J].

    Attributes:
        kinetic: of both legs and the hip.
        gravitational: zero with all mass at the origin of the slope's frame.
        elastic: stored in the feet that touch.
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
        gravity: of gravity on the walker.
        indentation: of the walker on the ground's normal reaction, F_N δ̇, both feet together.
        damper: what of it is lost while a foot touches, (F_N − elastic force) δ̇.
        friction: lost to friction, never negative.
        actuation: of the actuators, springs and dampers between the legs among them; None for a
            passive walker.
        motors: of each motor by itself, as `ActuatorPowers` has them; None for a passive walker.
    """

    gravity: Scalar
    indentation: Scalar
    damper: Scalar
    friction: Scalar
    actuation: Scalar | None = None
    motors: tuple[Scalar, ...] | None = None


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
    elastic = sum(_elastic_energy(scene, foot) for foot in feet(scene, state))
    return Energies(kinetic, scene.ground.g * moment, jnp.asarray(elastic))


def kinetic_and_moment(scene: AbstractWalkerScene, state: State) -> tuple[Scalar, Scalar]:
    """Kinetic energy [J] and mass times height [kg·m] of a walker of any kind."""
    walker, ground = scene.walker, scene.ground
    hip = minimal_state(scene, state)
    kinetic = 0.5 * walker.hip_mass * (hip.hip_vx**2 + hip.hip_vz**2)
    moment_x = walker.hip_mass * hip.hip_x
    moment_z = walker.hip_mass * hip.hip_z
    for leg in legs_of(scene, state):
        sine, cosine = jnp.sin(leg.angle), jnp.cos(leg.angle)
        vx = leg.hip_vx + walker.d * cosine * leg.rate
        vz = leg.hip_vz + walker.d * sine * leg.rate
        kinetic = kinetic + 0.5 * (walker.m * (vx**2 + vz**2) + walker.J * leg.rate**2)
        moment_x = moment_x + walker.m * (leg.hip_x + walker.d * sine)
        moment_z = moment_z + walker.m * (leg.hip_z - walker.d * cosine)
    height = moment_z * jnp.cos(ground.slope) - moment_x * jnp.sin(ground.slope)
    return kinetic, height


@kept_alone
def powers(scene: Scene, state: State) -> Powers:
    """Power of gravity and the contact's powers; leaves shaped as the state's.

    Args:
        scene: the walker on its ground.
        state: leaves of any common shape, SI units.

    Returns:
        The powers [W], leaves shaped as the state's.
    """
    walker, ground = scene.walker, scene.ground
    hip = minimal_state(scene, state)
    momentum_x = walker.total_mass * hip.hip_vx
    momentum_z = walker.total_mass * hip.hip_vz
    for leg in legs_of(scene, state):
        momentum_x = momentum_x + walker.m * walker.d * jnp.cos(leg.angle) * leg.rate
        momentum_z = momentum_z + walker.m * walker.d * jnp.sin(leg.angle) * leg.rate
    gravity = ground.g * (jnp.sin(ground.slope) * momentum_x - jnp.cos(ground.slope) * momentum_z)
    indentation = damper = friction = jnp.zeros_like(hip.hip_x)
    for foot in feet(scene, state):
        force = foot_force(scene, foot)
        held = jnp.where(touches(foot), scene.normal.elastic_force(foot.penetration), 0.0)
        indentation = indentation + force.normal * foot.penetration_rate
        damper = damper + (force.normal - held) * foot.penetration_rate
        if force.tangential is not None:
            friction = friction - force.tangential * foot.slip_speed
    if scene.actuation is None:
        return Powers(gravity, indentation, damper, friction)
    actuators = _actuator_powers(scene, state)
    return Powers(gravity, indentation, damper, friction, actuators.total, actuators.motors)


def _actuator_powers(scene: Scene, state: State) -> ActuatorPowers:
    first, second = legs_of(scene, state)
    angles, rates, both = (first.angle, second.angle), (first.rate, second.rate), feet(scene, state)
    hip = hip_motion(scene, both, angles, rates)
    return actuator_powers(scene, hip, normal_forces(scene, both))


def _elastic_energy(scene: Scene, foot: Foot) -> Scalar:
    return jnp.where(touches(foot), scene.normal.elastic_energy(foot.penetration), 0.0)

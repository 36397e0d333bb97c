"""Actuation in the equations of motion: torques at joints, set points of feet, their powers."""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, TypeAlias, TypeVar

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._footfalls import LegMotion
from jaxbiped.dynamics._joint_loads import with_joint_loads
from jaxbiped.dynamics._motor_motion import motor_torques
from jaxbiped.dynamics._tree import Loads, Motion
from jaxbiped.scene._scene import CompliantScene, RigidScene
from jaxbiped.scene.actuation._abstract_actuator import (
    AbstractActuator,
    AbstractHipActuator,
    HipMotion,
    LegTorques,
)
from jaxbiped.scene.actuation._actuators import FootPreload

WalkerScene: TypeAlias = CompliantScene | RigidScene
"""A walker that may be driven."""

_Part = TypeVar("_Part", bound=AbstractActuator)

_LIGHT = 0.01
"""Share of the walker's weight under which the loads on the feet no longer tell who stands."""


def actuators_of(scene: WalkerScene, kind: type[_Part]) -> tuple[_Part, ...]:
    """The scene's actuators of a kind, none where it is passive; known before anything runs."""
    return tuple(part for part in scene.actuation or () if isinstance(part, kind))


def _at_hip(scene: WalkerScene) -> tuple[AbstractHipActuator, ...]:
    return actuators_of(scene, AbstractHipActuator)  # type: ignore[type-abstract]


def _sums(pairs: Iterable[tuple[Scalar, Scalar]]) -> tuple[Scalar, Scalar] | None:
    """Both sums over pairs; None where there are none."""
    added = None
    for first, second in pairs:
        added = (first, second) if added is None else (added[0] + first, added[1] + second)
    return added


def load_shares(scene: WalkerScene, normal: tuple[Scalar | None, ...]) -> tuple[Scalar | None, ...]:
    """Share of the load on each foot, of normal forces [N]; None for one that never touches.

    F_i/(ΣF + ε W) with a hundredth ε of the weight W: smooth, and zero in flight.
    """
    total: Scalar = _LIGHT * scene.mechanism.total_mass * scene.ground.g
    for force in normal:
        total = total if force is None else total + force
    return tuple(None if force is None else force / total for force in normal)


def hip_torques(scene: WalkerScene, hip: HipMotion) -> LegTorques | None:
    """Torque of all actuators on each leg [N·m]; None where the scene has none at the hip."""
    return _sums(part.torques(hip) for part in _at_hip(scene))


def preload(scene: WalkerScene, leg: LegMotion) -> tuple[Scalar, Scalar] | None:
    """Extension of a leg's feet [m] and its rate [m/s]; None where the scene has no preload."""
    parts = actuators_of(scene, FootPreload)
    return _sums(part.set_point(leg.angle, leg.rate) for part in parts)


Carriers: TypeAlias = tuple[Sequence[LegMotion], Sequence[Scalar | None]]
"""Lines of all legs, and the share of the load on each; None for one that never touches."""


def with_driven_joints(
    loads: Loads,
    scene: WalkerScene,
    motion: Motion,
    carriers: Callable[[], Carriers],
    hip: Callable[[], HipMotion],
) -> Loads:
    """With the torques of springs, stops, latches, motors and actuators at the hip.

    Args:
        loads: what acts besides.
        scene: whose parts they are.
        motion: angles and rates of all bodies.
        carriers: which legs carry, asked where there are motors.
        hip: what actuators at the hip know, asked where there are any.
    """
    mechanism, slope = scene.mechanism, scene.ground.slope
    loads = with_joint_loads(loads, mechanism, motion, slope, stops=scene.compliant)
    if mechanism.has_motors:
        for _, angle, torque in motor_torques(mechanism, motion, slope, *carriers()):
            loads = loads.with_torques(angle.weights, torque)
    pairs = mechanism.structure.pairs
    if scene.actuation is not None and pairs:
        for body, torque in zip(pairs[0], hip_torques(scene, hip()) or (), strict=False):
            loads = loads.with_torques(((body, 1.0),), torque)
    return loads


class ActuatorPowers(NamedTuple):
    """Powers of a scene's actuators, leaves shaped as the state's.

    Attributes:
        total: power of all torques and set points on the walker, including springs and dampers [W].
        motors: power of each motor [W]: one for each actuator at the hip that has a motor, then
            one for each foot.
    """

    total: Scalar
    motors: tuple[Scalar, ...]


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
        driven = (part.motor_torques(hip) for part in _at_hip(scene))
        motors += [_power(each, hip) for each in driven if each is not None]
    for force, leg in feet:
        moved = preload(scene, leg)
        if moved is not None and force is not None:
            motors.append(force * moved[1])
            total = total + motors[-1]
    return ActuatorPowers(total, tuple(motors))


def _power(torques: LegTorques, hip: HipMotion) -> Scalar:
    return torques[0] * hip.rate[0] + torques[1] * hip.rate[1]

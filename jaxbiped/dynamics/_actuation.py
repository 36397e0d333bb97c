"""Actuation in the equations of motion: torques at the hip, set points of feet, their powers."""

from collections.abc import Iterable
from typing import NamedTuple, TypeAlias, TypeVar

import jax.numpy as jnp

from jaxbiped._types import Scalar
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


def load_shares(
    scene: WalkerScene, normal: tuple[Scalar | None, Scalar | None]
) -> tuple[Scalar | None, Scalar | None]:
    """Share of the load on each leg, of normal forces [N]; None for a foot that never touches.

    F_i/(F_1 + F_2 + ε W) with a hundredth ε of the weight W: smooth, and zero in flight.
    """
    total: Scalar = _LIGHT * scene.walker.total_mass * scene.ground.g
    for force in normal:
        total = total if force is None else total + force
    first, second = (None if force is None else force / total for force in normal)
    return first, second


def hip_torques(scene: WalkerScene, hip: HipMotion) -> LegTorques | None:
    """Torque of all actuators on each leg [N·m]; None where the scene has none at the hip."""
    return _sums(part.torques(hip) for part in _at_hip(scene))


def preload(scene: WalkerScene, angle: Scalar, rate: Scalar) -> tuple[Scalar, Scalar] | None:
    """Extension of a leg's foot [m] and its rate [m/s]; None where the scene has no preload."""
    return _sums(part.set_point(angle, rate) for part in actuators_of(scene, FootPreload))


class ActuatorPowers(NamedTuple):
    """Powers of a scene's actuators, leaves shaped as the state's.

    Attributes:
        total: of all torques and set points on the walker, of springs and dampers too [W].
        motors: of each motor by itself [W]: one for each actuator at the hip that has one, then one
            for each leg's foot.
    """

    total: Scalar
    motors: tuple[Scalar, ...]


def actuator_powers(
    scene: WalkerScene, hip: HipMotion, normal: tuple[Scalar | None, Scalar | None]
) -> ActuatorPowers:
    """Powers of the actuators of a walker that moves like this under these normal forces [N]."""
    total, motors = jnp.zeros_like(hip.angle[0]), []
    torques = hip_torques(scene, hip)
    if torques is not None:
        total = total + _power(torques, hip)
    for part in _at_hip(scene):
        driven = part.motor_torques(hip)
        if driven is not None:
            motors.append(_power(driven, hip))
    for force, angle, rate in zip(normal, hip.angle, hip.rate, strict=True):
        moved = preload(scene, angle, rate)
        if moved is not None and force is not None:
            motors.append(force * moved[1])
            total = total + motors[-1]
    return ActuatorPowers(total, tuple(motors))


def _power(torques: LegTorques, hip: HipMotion) -> Scalar:
    return torques[0] * hip.rate[0] + torques[1] * hip.rate[1]

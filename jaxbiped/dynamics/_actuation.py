"""Actuation in the equations of motion: motors, and the motion that their laws see; actuators."""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, TypeAlias, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, is_number
from jaxbiped._types import Scalar
from jaxbiped.dynamics._footfalls import LegMotion
from jaxbiped.dynamics._joint_loads import with_joint_loads
from jaxbiped.dynamics._tree import Loads, Motion
from jaxbiped.scene._joint_parts import Motor
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._motor_motion import MotorMotion, exchange_of
from jaxbiped.scene._scene import CompliantScene, RigidScene
from jaxbiped.scene._structure import Angle, Structure
from jaxbiped.scene.actuation._actuators import (
    AbstractActuator,
    AbstractHipActuator,
    FootPreload,
    HipMotion,
    LegTorques,
)


def exchanged(structure: Structure, motion: Motion) -> Motion:
    """The same motion with the names of both sides exchanged."""
    twin = exchange_of(structure)
    return motion._replace(
        angles=tuple(motion.angles[j] for j in twin), rates=tuple(motion.rates[j] for j in twin)
    )


def swings_at_section(structure: Structure, leg: int) -> bool:
    """Whether a leg is on the side of the mirror that swings where a cycle begins."""
    return any(first in structure.bodies_of_leg(leg) for first, _ in structure.pairs)


class MotorTorque(NamedTuple):
    """Torque of a motor [N·m], and the angle on which it acts."""

    angle: Angle
    torque: Scalar


def motor_torque(
    mechanism: Mechanism,
    number: int,
    motion: Motion,
    slope: Scalar,
    leg: int | None = None,
    line: LegMotion | None = None,
) -> MotorTorque:
    """The torque of a motor while a leg stands.

    The law of a motor by role is written for the second of each pair standing. While the first one
    stands, the law sees the motion with both sides exchanged, and its torque is exchanged back.

    Args:
        mechanism: whose motor it is.
        number: of the motor among the joint parts.
        motion: angles and rates of all bodies.
        slope: angle of the vertical [rad].
        leg: number of the leg that stands; None for none.
        line: from the root point to its feet.
    """
    structure, motor = mechanism.structure, mechanism.joints[number]
    assert isinstance(motor, Motor)
    joint = structure.joints[number]
    as_written = motor.by == "side" or leg is None or not swings_at_section(structure, leg)
    motion = motion if as_written else exchanged(structure, motion)
    seen = MotorMotion(structure, motion.angles, motion.rates, slope, joint, line, motion.clock)
    angle = joint if as_written else joint.mirrored(exchange_of(structure))
    return MotorTorque(angle, _law_torque(motor, seen))


def _law_torque(motor: Motor, motion: MotorMotion) -> Scalar:
    words = f"the law of Motor({motor.angle!r})"
    try:
        torque = motor.law(motion)
    except (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError) as error:
        raise ArgumentError(
            f"{words} takes the motion for plain numbers, which is not allowed: write it with "
            "jax.numpy, and a choice with jax.numpy.where."
        ) from error
    is_one = not isinstance(torque, list | tuple) and is_number(torque)
    if not is_one and not isinstance(torque, jax.Array):
        raise ArgumentError(_not_one_torque(words, repr(torque)))
    given = motion.angles, motion.rates, motion.slope, motion.clock, motor
    leaves = jtu.tree_leaves(eqx.filter(given, eqx.is_array_like))
    shape, most = np.shape(torque), np.broadcast_shapes(*map(np.shape, leaves))
    if shape != most[len(most) - len(shape) :] or jnp.iscomplexobj(torque):
        array = f"an array of the shape {shape} and the type {jnp.result_type(torque)}"
        raise ArgumentError(_not_one_torque(words, array))
    return jnp.asarray(torque) if motor.share is None else motor.share * torque


def _not_one_torque(words: str, returned: str) -> str:
    return f"{words} returns {returned}, which is not allowed: it must return one torque [N m]."


def motor_torques(
    mechanism: Mechanism,
    motion: Motion,
    slope: Scalar,
    legs: Sequence[LegMotion],
    shares: Sequence[Scalar | None],
) -> list[tuple[int, Angle, Scalar]]:
    """Torques of all motors, those by role once for each leg that may carry [N·m].

    Args:
        mechanism: whose motors they are.
        motion: angles and rates of all bodies.
        slope: angle of the vertical [rad].
        legs: the line of each leg.
        shares: of the load, on each leg; None for one that never touches.

    Returns:
        The motor's number among the joint parts, the angle on which it acts, and the torque.
    """
    structure, found = mechanism.structure, []
    for number, motor in enumerate(mechanism.joints):
        if not isinstance(motor, Motor):
            continue
        if motor.by == "side" or not structure.pairs:
            found.append((number, *motor_torque(mechanism, number, motion, slope)))
            continue
        for leg, (line, share) in enumerate(zip(legs, shares, strict=True)):
            if share is not None:
                told = motor_torque(mechanism, number, motion, slope, leg, line)
                found.append((number, told.angle, share * told.torque))
    return found


WalkerScene: TypeAlias = CompliantScene | RigidScene
"""A walker that may be driven."""

_Part = TypeVar("_Part", bound=AbstractActuator)

_LIGHT = 0.01
"""Share of the walker's weight under which the loads on the feet no longer tell who stands."""


def actuators_of(scene: WalkerScene, kind: type[_Part]) -> tuple[_Part, ...]:
    """The scene's actuators of a kind, none where it is passive; known before anything runs."""
    return tuple(part for part in scene.actuation or () if isinstance(part, kind))


def hip_actuators(scene: WalkerScene) -> tuple[AbstractHipActuator, ...]:
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
    return _sums(part.torques(hip) for part in hip_actuators(scene))


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

    `carriers` is called only where there are motors, `hip` only where there are hip actuators.
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

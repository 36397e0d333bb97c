"""Interfaces of actuators: what they may know of the walker, and what they do to it.

They are functions of the state alone, smooth and the same for both legs, so that a walker with them
is still an autonomous system whose legs may be exchanged.
"""

import abc
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self, TypeAlias, cast

import jax.numpy as jnp
from equinox import AbstractVar

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped._parameter_declaration import AbstractNamedPart
from jaxbiped._types import Scalar

LegTorques: TypeAlias = tuple[Scalar, Scalar]
"""Torques on leg 1 and leg 2 that increase their angles [N·m]."""

REACTIONS = ("swing", "trunk")

ACTUATORS: dict[str, type["AbstractActuator"]] = {}
"""Each actuator by name."""


class HipMotion(NamedTuple):
    """Motion that an actuator at the hip can use; pairs for leg 1 and leg 2.

    Attributes:
        angle: angles from the slope's normal [rad].
        rate: rates of the angles [rad/s].
        load: share of the load that each leg carries [–], one if it stands alone; None for a leg
            that is known to carry nothing.
    """

    angle: tuple[Scalar, Scalar]
    rate: tuple[Scalar, Scalar]
    load: tuple[Scalar | None, Scalar | None]


class AbstractActuator(AbstractNamedPart):
    """A device that drives the walker or stores energy for it; listed in `ACTUATORS` by its `name`.

    Attributes:
        feet: the feet that it needs, "rigid" or "compliant", None for any. A property of the class.
    """

    catalogue: ClassVar[dict[str, Any]] = ACTUATORS
    feet: ClassVar[str | None] = None

    @abc.abstractmethod
    def idle(self) -> Self:
        """The same actuator at strength zero, at which a search for a driven gait may begin."""


class AbstractHipActuator(AbstractActuator):
    """An actuator that turns the legs about the hip."""

    @abc.abstractmethod
    def torques(self, hip: HipMotion) -> LegTorques:
        """Total torque on each leg [N·m]."""

    @abc.abstractmethod
    def motor_torques(self, hip: HipMotion) -> LegTorques | None:
        """Torques of a motor alone, without springs and dampers [N·m]; None without a motor."""


class AbstractPhaseTorque(AbstractHipActuator):
    """A torque at the hip that is a function of the phase: how far the stance leg has turned.

    The phase is minus the stance leg's angle [rad], which grows as the walker rolls over that leg.
    The torque does not depend on time, so the system stays autonomous. A positive torque drives the
    walker downhill: it turns the stance leg back. In double support, the torque of each leg is
    weighted by the load that it carries.

    Attributes:
        reaction: part that takes the opposite torque: "swing", the other leg, which it swings
            forward; or "trunk", an upright trunk that is not modelled.
    """

    reaction: AbstractVar[str]

    def __check_init__(self) -> None:
        check_choice("reaction", self.reaction, REACTIONS)

    @abc.abstractmethod
    def torque_at(self, phase: Scalar) -> Scalar:
        """Torque at a phase [rad], positive if it drives the walker downhill [N·m]."""

    def torques(self, hip: HipMotion) -> LegTorques:
        driving = [
            None if load is None else load * self.torque_at(-angle)
            for load, angle in zip(hip.load, hip.angle, strict=True)
        ]
        legs = []
        for own, other in (driving, driving[::-1]):
            back = 0.0 if own is None else own
            forward = 0.0 if other is None or self.reaction == "trunk" else other
            legs.append(jnp.asarray(forward - back))
        return legs[0], legs[1]

    def motor_torques(self, hip: HipMotion) -> LegTorques:
        return self.torques(hip)


Actuation: TypeAlias = Any
"""A tuple of a scene's actuators, None where it is passive; users also write one actuator."""


def actuation_of(parts: AbstractActuator | Sequence[AbstractActuator] | None) -> Actuation:
    """One part, several or none as a scene keeps them."""
    if parts is None:
        return None
    if isinstance(parts, AbstractActuator):
        return (parts,)
    # What is neither is refused by `check_actuation`, with what it is.
    return tuple(parts) or None if isinstance(parts, list | tuple) else (cast(Any, parts),)


def check_actuation(actuation: Actuation, feet: str, *, mirrored: bool) -> None:
    """Raises `ArgumentError` for what is no actuator, or one that such a walker cannot have.

    Args:
        actuation: the actuators.
        feet: kind of the walker's feet, "compliant" or "rigid".
        mirrored: whether it has a pair of bodies, which an actuator at the hip acts between.
    """
    for part in actuation or ():
        check_type("actuation", part, AbstractActuator)
        if part.feet not in (None, feet):
            raise ArgumentError(
                f"actuation = {type(part).__name__} is not allowed with {feet} feet: it needs "
                f"{part.feet} ones."
            )
        if isinstance(part, AbstractHipActuator) and not mirrored:
            raise ArgumentError(
                f"actuation = {type(part).__name__} is not allowed for a mechanism without a "
                "mirror: it acts between the bodies of a pair; give mirror= or use joint parts."
            )

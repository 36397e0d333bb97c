"""Constant torque at the hip."""

import dataclasses
from typing import ClassVar, Self

import equinox as eqx

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.actuation._abstract_actuator import AbstractPhaseTorque


class HipTorque(AbstractPhaseTorque):
    """The same torque at every phase.

    Attributes (leaves of any batch shape):
        torque: positive where it drives the walker downhill [N·m].
        reaction: see `AbstractPhaseTorque`.

    Raises:
        ArgumentError: an unknown reaction.
    """

    name: ClassVar[str] = "hip-torque"
    torque: Parameter = parameter("hip torque", r"$\tau$", "N m")
    reaction: str = eqx.field(static=True, default="swing")

    def torque_at(self, phase: Scalar) -> Scalar:
        return self.torque

    def idle(self) -> Self:
        return dataclasses.replace(self, torque=0.0 * self.torque)

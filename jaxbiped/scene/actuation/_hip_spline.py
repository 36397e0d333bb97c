"""Torque at the hip as a spline over phase, with its coefficients as parameters."""

import dataclasses
from typing import ClassVar, Self

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import ArgumentError, holds_somewhere
from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.actuation._abstract_actuator import AbstractPhaseTorque

_DIFFERENCE = (1.0 / 6.0, -4.0 / 6.0, 1.0, -4.0 / 6.0, 1.0 / 6.0)


class HipSpline(AbstractPhaseTorque):
    """Σ τ_i B(φ/h − i), cubic B-splines at n phases of equal distance h; the parameters τ_1 … τ_n.

    Twice continuously differentiable; it falls to zero within 2 h before the first phase and
    beyond the last. Where all τ_i are equal, so is the torque from the second phase to the last but
    one.

    Source: de Boor, A Practical Guide to Splines (2001), chapter IX.

    Attributes (leaves of any batch shape):
        torque: coefficients τ_1 … τ_n, two or more, positive where they drive the walker downhill
            [N·m]; parameters by the names `torque_1` and so on.
        first, last: phases of the first and the last: minus the stance leg's angle [rad].
        reaction: see `AbstractPhaseTorque`.

    Raises:
        ArgumentError: fewer than two coefficients, last not above first, or an unknown reaction.
    """

    name: ClassVar[str] = "hip-spline"
    torque: tuple[Parameter, ...] = parameter("hip torque", r"$\tau$", "N m", several=True)
    first: Parameter = parameter("first phase", r"$\varphi_1$", "rad", default=-0.2)
    last: Parameter = parameter("last phase", r"$\varphi_n$", "rad", default=0.2)
    reaction: str = eqx.field(static=True, default="swing")

    def __check_init__(self) -> None:
        if len(self.torque) < 2:
            raise ArgumentError(
                f"torque has length {len(self.torque)}, which is not allowed: give two or more "
                "coefficients."
            )
        if holds_somewhere(self.last <= self.first):
            raise ArgumentError(
                f"last = {self.last} is not allowed with first = {self.first}: it must be above."
            )

    def torque_at(self, phase: Scalar) -> Scalar:
        count = len(self.torque)
        place = (phase - self.first) * (count - 1) / (self.last - self.first)
        cubes = []
        for j in range(count + 4):
            beyond = jnp.maximum(place + (2.0 - j), 0.0)
            cubes.append(beyond * beyond * beyond)
        splines = (
            sum(weight * cubes[i + j] for j, weight in enumerate(_DIFFERENCE)) for i in range(count)
        )
        return jnp.asarray(sum(a * b for a, b in zip(self.torque, splines, strict=True)))

    def idle(self) -> Self:
        return dataclasses.replace(self, torque=tuple(0.0 * each for each in self.torque))

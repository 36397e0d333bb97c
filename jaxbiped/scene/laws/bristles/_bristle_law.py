"""Interface of bristle laws: friction with a state, bristles that bend before they slip."""

import abc
from typing import ClassVar

import equinox as eqx

from jaxbiped._parameter import check_parameters
from jaxbiped._types import Scalar


class AbstractBristleLaw(eqx.Module):
    """Friction by bristles whose deflection is a state of its own, one number for each foot.

    The number is what the bristles' stiffness makes of their deflection, as a share of the normal
    force [–]: a deflection would be too small for the tolerances of the other components. Bristles
    work into contact with the load, w = F_N/(F_N + engaging_load), and relax out of it:

        ḃ = w (rate of the law) − (1 − w) relaxation b

    so that a foot lands with straight bristles and nothing jumps as it does.

    Attributes:
        name: as an `AbstractFrictionLaw` has it, with `like_seed`. A property of the class.
    """

    name: ClassVar[str | None] = None

    def __check_init__(self) -> None:
        check_parameters(self)

    @abc.abstractmethod
    def engagement(self) -> tuple[Scalar, Scalar]:
        """Engaging load [N] and relaxation [1/s]."""

    @abc.abstractmethod
    def rate(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        """Rate of the bristle's share of the load [1/s] in full contact."""

    @abc.abstractmethod
    def coefficient(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        """Friction as a share of the normal force [–], of the sign of the slip that it opposes."""

    def force(self, normal_force: Scalar, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        """Tangential force [N] along the slope."""
        return -normal_force * self.coefficient(slip_speed, bristle)

    def bristle_rate(self, normal_force: Scalar, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        """Rate of the bristle's share of the load [1/s], in contact or out of it."""
        load, relaxation = self.engagement()
        engaged = normal_force / (normal_force + load)
        rate = engaged * self.rate(slip_speed, bristle)
        return rate - (1.0 - engaged) * relaxation * bristle

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        """The slip speed: a bent bristle's rate has a corner where it changes sign."""
        return (slip_speed,)

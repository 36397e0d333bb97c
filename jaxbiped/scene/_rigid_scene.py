"""A scene without contact laws: the rigid limit."""

from typing import ClassVar

import equinox as eqx

from jaxbiped._checks import check_type
from jaxbiped.scene._abstract_scene import AbstractScene
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._walker import Walker
from jaxbiped.scene.actuation._abstract_actuator import (
    Actuation,
    actuation_of,
    check_actuation,
)


class RigidScene(AbstractScene):
    """A walker whose feet are rigid: they roll without slip and strike without rebound.

    Single support is a smooth motion of two legs; a footstep ends by a plastic impact at which the
    feet exchange support at once, and a swing foot that passes through the ground does not touch
    it. Nothing is stiff, so a footstep costs a small part of one with compliant feet. Whether a
    real foot would have slipped, flown or scuffed is told by `rigid_checks`.

    Attributes:
        walker: masses and lengths.
        ground: slope and gravity.
        actuation: what drives it beside gravity, a part of `jaxbiped.actuation` or several; None
            for a passive walker, whose equations have nothing of it.

    Raises:
        ArgumentError: a part of the wrong type, or an actuator of compliant feet.
    """

    compliant: ClassVar[bool] = False
    redundant: ClassVar[bool] = False
    walker: Walker
    ground: Ground
    actuation: Actuation = eqx.field(converter=actuation_of, default=None)

    def __check_init__(self) -> None:
        check_type("walker", self.walker, Walker)
        check_type("ground", self.ground, Ground)
        check_actuation(self.actuation, "rigid")

    @property
    def minimal(self) -> "RigidScene":
        return self

    def with_minimal(self, minimal: "RigidScene") -> "RigidScene":
        return minimal

    @property
    def has_bristles(self) -> bool:
        return False

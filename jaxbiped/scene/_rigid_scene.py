"""A scene without contact laws: the rigid limit."""

import equinox as eqx

from jaxbiped._checks import check_type
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._walker import Walker


class RigidScene(eqx.Module):
    """A walker whose feet are rigid: they roll without slip and strike without rebound.

    Single support is a smooth motion of two legs; a footstep ends by a plastic impact at which the
    feet exchange support at once, and a swing foot that passes through the ground does not touch
    it. Nothing is stiff, so a footstep costs a small part of one with compliant feet. Whether a
    real foot would have slipped, flown or scuffed is told by `rigid_checks`.

    Attributes:
        walker: masses and lengths.
        ground: slope and gravity.

    Raises:
        ArgumentError: a part of the wrong type.
    """

    walker: Walker
    ground: Ground

    def __check_init__(self) -> None:
        check_type("walker", self.walker, Walker)
        check_type("ground", self.ground, Ground)

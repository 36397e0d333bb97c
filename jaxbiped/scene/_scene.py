"""A scene: everything that is modelled."""

from typing import ClassVar

import equinox as eqx

from jaxbiped._checks import check_type
from jaxbiped.scene._abstract_scene import AbstractScene
from jaxbiped.scene._clearance import AbstractClearance, StanceRotation
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._walker import Walker
from jaxbiped.scene.actuation._abstract_actuator import (
    Actuation,
    actuation_of,
    check_actuation,
)
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw, AbstractNormalLaw
from jaxbiped.scene.laws.bristles._bristle_law import AbstractBristleLaw


class Scene(AbstractScene):
    """A walker on a slope, with its laws of contact.

    A frozen pytree whose numeric leaves are the parameters: differentiate or `vmap` with respect
    to any of them by replacing it, for example
    `equinox.tree_at(lambda s: s.normal.K, scene, jnp.asarray(2e6))`.

    Attributes:
        walker: masses and lengths.
        ground: slope and gravity.
        normal: law of the normal force.
        friction: law of the tangential force; with bristles, states are `BristleState`s.
        clearance: which foot may touch.
        actuation: what drives it beside gravity, a part of `jaxbiped.actuation` or several; None
            for a passive walker, whose equations have nothing of it.

    Raises:
        ArgumentError: a part of the wrong type, or an actuator of rigid feet.
    """

    compliant: ClassVar[bool] = True
    redundant: ClassVar[bool] = False
    walker: Walker
    ground: Ground
    normal: AbstractNormalLaw
    friction: AbstractFrictionLaw | AbstractBristleLaw
    clearance: AbstractClearance = StanceRotation()
    actuation: Actuation = eqx.field(converter=actuation_of, default=None)

    def __check_init__(self) -> None:
        check_type("walker", self.walker, Walker)
        check_type("ground", self.ground, Ground)
        check_type("normal", self.normal, AbstractNormalLaw)
        check_type("friction", self.friction, AbstractFrictionLaw, AbstractBristleLaw)
        check_type("clearance", self.clearance, AbstractClearance)
        check_actuation(self.actuation, "compliant")

    @property
    def minimal(self) -> "Scene":
        return self

    def with_minimal(self, minimal: "Scene") -> "Scene":
        return minimal

    @property
    def has_bristles(self) -> bool:
        return isinstance(self.friction, AbstractBristleLaw)

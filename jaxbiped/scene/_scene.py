"""A scene: everything that is modelled."""

import equinox as eqx

from jaxbiped._checks import check_type
from jaxbiped.scene._clearance import AbstractClearance, StanceRotation
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._walker import Walker
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw, AbstractNormalLaw
from jaxbiped.scene.laws.bristles._bristle_law import AbstractBristleLaw


class Scene(eqx.Module):
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

    Raises:
        ArgumentError: a part of the wrong type.
    """

    walker: Walker
    ground: Ground
    normal: AbstractNormalLaw
    friction: AbstractFrictionLaw | AbstractBristleLaw
    clearance: AbstractClearance = StanceRotation()

    def __check_init__(self) -> None:
        check_type("walker", self.walker, Walker)
        check_type("ground", self.ground, Ground)
        check_type("normal", self.normal, AbstractNormalLaw)
        check_type("friction", self.friction, AbstractFrictionLaw, AbstractBristleLaw)
        check_type("clearance", self.clearance, AbstractClearance)

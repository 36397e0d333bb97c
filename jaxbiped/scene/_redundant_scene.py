"""A scene whose legs have coordinates of their own."""

import dataclasses
from typing import ClassVar, TypeAlias

import equinox as eqx

from jaxbiped._checks import check_choice, check_type
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod
from jaxbiped.constraints._constraint_methods import method_named
from jaxbiped.constraints._index1 import Index1
from jaxbiped.constraints._linkage import ORIENTATIONS, Linkage
from jaxbiped.scene._abstract_scene import AbstractScene
from jaxbiped.scene._clearance import AbstractClearance
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._walker import Walker
from jaxbiped.scene._walker_linkage import walker_linkage
from jaxbiped.scene.actuation._abstract_actuator import Actuation
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw, AbstractNormalLaw
from jaxbiped.scene.laws.bristles._bristle_law import AbstractBristleLaw


class RedundantScene(AbstractScene):
    """A walker whose legs are bodies of their own, held together at the hip by a method.

    What is modelled is the `Scene`; how it is written down differs. Goes wherever a `Scene` does;
    states are `RedundantState`s (or `EulerState`s), made from a `State` where one is given.

    Source: the seed paper, section 4.

    Attributes:
        scene: what is modelled.
        method: how the hip is held, one of `CONSTRAINT_METHODS` by its name or an object.
        orientation: how legs' orientations are written, one of `ORIENTATIONS`.

    Raises:
        ArgumentError: a part of the wrong type, or an unknown name.
    """

    compliant: ClassVar[bool] = True
    redundant: ClassVar[bool] = True
    scene: Scene
    method: AbstractConstraintMethod = eqx.field(converter=method_named, default_factory=Index1)
    orientation: str = eqx.field(static=True, default="angle")

    def __check_init__(self) -> None:
        check_type("scene", self.scene, Scene)
        check_choice("orientation", self.orientation, ORIENTATIONS)

    @property
    def minimal(self) -> Scene:
        return self.scene

    def with_minimal(self, minimal: Scene) -> "RedundantScene":
        return dataclasses.replace(self, scene=minimal)

    @property
    def has_bristles(self) -> bool:
        return self.scene.has_bristles

    @property
    def walker(self) -> Walker:
        """The scene's walker."""
        return self.scene.walker

    @property
    def ground(self) -> Ground:
        """The scene's ground."""
        return self.scene.ground

    @property
    def normal(self) -> AbstractNormalLaw:
        """The scene's law of the normal force."""
        return self.scene.normal

    @property
    def friction(self) -> AbstractFrictionLaw | AbstractBristleLaw:
        """The scene's law of friction."""
        return self.scene.friction

    @property
    def clearance(self) -> AbstractClearance:
        """The scene's rule of clearance."""
        return self.scene.clearance

    @property
    def actuation(self) -> Actuation:
        """The scene's actuators."""
        return self.scene.actuation

    @property
    def linkage(self) -> Linkage:
        """The legs and the hip as a linkage."""
        return walker_linkage(self.scene.walker, self.orientation)


CompliantScene: TypeAlias = Scene | RedundantScene
"""A walker with laws of contact, in minimal or redundant coordinates."""

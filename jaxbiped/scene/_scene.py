"""Scenes: all that is modelled, with laws of contact, rigid feet or redundant coordinates."""

import abc
import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeAlias

import equinox as eqx
from equinox import AbstractVar

from jaxbiped._checks import check_choice, check_type
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod
from jaxbiped.constraints._constraint_methods import Index1, method_named
from jaxbiped.constraints._linkage import ORIENTATIONS, Linkage
from jaxbiped.scene._ground import AbstractClearance, Ground, StanceRotation
from jaxbiped.scene._walker import Walker, walker_linkage
from jaxbiped.scene.actuation._abstract_actuator import Actuation, actuation_of, check_actuation
from jaxbiped.scene.laws._abstract_laws import (
    AbstractBristleLaw,
    AbstractFrictionLaw,
    AbstractNormalLaw,
)

if TYPE_CHECKING:
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar


class AbstractScene(eqx.Module):
    """What is modelled, and how it is written down; a frozen pytree of its parameters.

    Attributes:
        compliant: whether feet sink into the ground and slip on it by laws of contact; else they
            roll and strike. A property of the class.
        redundant: whether constraints hold more coordinates together than there are degrees of
            freedom. A property of the class.
    """

    compliant: AbstractClassVar[bool]
    redundant: AbstractClassVar[bool]

    @property
    @abc.abstractmethod
    def minimal(self) -> Any:
        """The same model in minimal coordinates, whose leaves are the parameters."""

    @abc.abstractmethod
    def with_minimal(self, minimal: Any) -> Self:
        """The scene of another model, held together as this one is."""


class AbstractWalkerScene(AbstractScene):
    """A walker on a slope, and how it is modelled.

    Attributes:
        walker: masses and lengths.
        ground: slope and gravity.
    """

    if TYPE_CHECKING:
        # A field of some scenes, a property of others.
        @property
        def walker(self) -> Walker: ...
        @property
        def ground(self) -> Ground: ...
    else:
        walker: AbstractVar[Walker]
        ground: AbstractVar[Ground]

    @property
    def has_bristles(self) -> bool:
        """Whether the friction has states of its own."""
        return isinstance(getattr(self.minimal, "friction", None), AbstractBristleLaw)


class AbstractMinimalScene(AbstractWalkerScene):
    """A walker in minimal coordinates."""

    redundant: ClassVar[bool] = False

    @property
    def minimal(self) -> Self:
        """The scene itself."""
        return self

    def with_minimal(self, minimal: Self) -> Self:
        """The other model itself."""
        return minimal


def is_compliant(args: object) -> bool:
    """Whether the parameters of a system are a scene with laws of contact."""
    return isinstance(args, AbstractWalkerScene) and args.compliant


def is_rigid(args: object) -> bool:
    """Whether the parameters of a system are a scene whose feet roll and strike."""
    return isinstance(args, AbstractWalkerScene) and not args.compliant


class Scene(AbstractMinimalScene):
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


class RigidScene(AbstractMinimalScene):
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
    walker: Walker
    ground: Ground
    actuation: Actuation = eqx.field(converter=actuation_of, default=None)

    def __check_init__(self) -> None:
        check_type("walker", self.walker, Walker)
        check_type("ground", self.ground, Ground)
        check_actuation(self.actuation, "rigid")


class RedundantScene(AbstractWalkerScene):
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

    def with_minimal(self, minimal: Scene) -> Self:
        return dataclasses.replace(self, scene=minimal)

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

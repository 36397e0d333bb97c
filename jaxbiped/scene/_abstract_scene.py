"""Scenes in general: what code that takes any kind of scene may ask of one."""

import abc
from typing import TYPE_CHECKING, Any, Self

import equinox as eqx
from equinox import AbstractVar

from jaxbiped.scene._ground import Ground
from jaxbiped.scene._walker import Walker

if TYPE_CHECKING:
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar


class AbstractScene(eqx.Module):
    """A walker on a slope, and how it is modelled; a frozen pytree of its parameters.

    Attributes:
        walker: masses and lengths.
        ground: slope and gravity.
        compliant: whether feet sink into the ground and slip on it by laws of contact; else they
            roll and strike. A property of the class.
        redundant: whether constraints hold more coordinates together than there are degrees of
            freedom. A property of the class.
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
    compliant: AbstractClassVar[bool]
    redundant: AbstractClassVar[bool]

    @property
    @abc.abstractmethod
    def minimal(self) -> Any:
        """The same model in minimal coordinates, whose leaves are the parameters: itself, unless
        it is redundant."""

    @abc.abstractmethod
    def with_minimal(self, minimal: Any) -> Self:
        """The scene of another model, held together as this one is."""

    @property
    @abc.abstractmethod
    def has_bristles(self) -> bool:
        """Whether the friction has states of its own."""


def is_compliant(args: object) -> bool:
    """Whether the parameters of a system are a scene with laws of contact."""
    return isinstance(args, AbstractScene) and args.compliant


def is_rigid(args: object) -> bool:
    """Whether the parameters of a system are a scene whose feet roll and strike."""
    return isinstance(args, AbstractScene) and not args.compliant

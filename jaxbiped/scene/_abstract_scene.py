"""What all scenes have in common."""

import abc
from typing import TYPE_CHECKING, Any, ClassVar, Self

import equinox as eqx
from equinox import AbstractVar

from jaxbiped._summary import in_short, notebook_html
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._mechanism import Mechanism, mechanism_of
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw

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

    __repr__ = in_short
    _repr_html_ = notebook_html

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
        def walker(self) -> Any: ...
        @property
        def ground(self) -> Ground: ...
    else:
        walker: AbstractVar[Any]
        ground: AbstractVar[Ground]

    @property
    def mechanism(self) -> Mechanism:
        """The walker as bodies, feet and joint parts."""
        return mechanism_of(self.walker)

    @property
    def arrival_footsteps(self) -> int:
        """Footsteps from one arrival at the section of a cycle to the next.

        Compliant feet strike by name: those of unlike legs arrive once a stride.
        """
        return self.mechanism.structure.cycle_footsteps if self.compliant else 1

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

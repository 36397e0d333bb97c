"""Linkages in gravity, by themselves, and their states."""

from typing import ClassVar, NamedTuple, Self

from jaxbiped._checks import check_type
from jaxbiped._parameter_declaration import check_parameters, parameter
from jaxbiped._types import Parameter, StateLeaf
from jaxbiped.constraints._constraint_methods import AbstractConstraintMethod
from jaxbiped.constraints._linkage import Linkage
from jaxbiped.scene._scene import AbstractScene


class LinkageState(NamedTuple):
    """Coordinates of a linkage and their rates: tuples of n scalar leaves of any batch shape.

    Each body has x, z [m] and θ [rad], or x, z and the Euler parameters cos θ/2, sin θ/2 [–].

    Attributes:
        q: the n coordinates.
        v: rates of the coordinates.
    """

    q: tuple[StateLeaf, ...]
    v: tuple[StateLeaf, ...]


class LinkageScene(AbstractScene):
    """A linkage in gravity, with the method that holds its joints.

    Attributes:
        linkage: bodies and joints.
        method: constraint method.
        gravity: acceleration (x, z) [m/s²].

    Raises:
        ArgumentError: a part has the wrong type, or gravity is not finite.
    """

    compliant: ClassVar[bool] = False
    redundant: ClassVar[bool] = True
    model: ClassVar[str] = "linkage"
    state_type: ClassVar[type] = LinkageState
    linkage: Linkage
    method: AbstractConstraintMethod
    gravity: tuple[Parameter, Parameter] = parameter(
        "gravity", "$g$", "m/s^2", several=True, default=(0.0, -9.8)
    )

    def __check_init__(self) -> None:
        check_type("linkage", self.linkage, Linkage)
        check_type("method", self.method, AbstractConstraintMethod)
        check_parameters(self)

    @property
    def minimal(self) -> Self:
        """The scene itself."""
        return self

    def with_minimal(self, minimal: Self) -> Self:
        """The other linkage itself."""
        return minimal

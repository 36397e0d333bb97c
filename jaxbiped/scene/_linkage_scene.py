"""A linkage in gravity."""

import equinox as eqx

from jaxbiped._checks import check_finite, check_type
from jaxbiped._types import Parameter, as_float
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod
from jaxbiped.constraints._linkage import Linkage


class LinkageScene(eqx.Module):
    """A linkage in gravity, and how its joints are held.

    Attributes:
        linkage: bodies and joints.
        method: how the constraints are held.
        gravity: acceleration (x, z) [m/s²].

    Raises:
        ArgumentError: a part of the wrong type, or gravity that is not finite.
    """

    linkage: Linkage
    method: AbstractConstraintMethod
    gravity: tuple[Parameter, Parameter] = eqx.field(
        converter=lambda g: tuple(map(as_float, g)), default=(0.0, -9.8)
    )

    def __check_init__(self) -> None:
        check_type("linkage", self.linkage, Linkage)
        check_type("method", self.method, AbstractConstraintMethod)
        for value in self.gravity:
            check_finite("gravity", value)

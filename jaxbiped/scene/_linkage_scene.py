"""A linkage in gravity."""

import equinox as eqx

from jaxbiped._checks import check_type
from jaxbiped._parameter import check_parameters, parameter
from jaxbiped._types import Parameter
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
    gravity: tuple[Parameter, Parameter] = parameter(
        "gravity", "$g$", "m/s^2", several=True, default=(0.0, -9.8)
    )

    def __check_init__(self) -> None:
        check_type("linkage", self.linkage, Linkage)
        check_type("method", self.method, AbstractConstraintMethod)
        check_parameters(self)

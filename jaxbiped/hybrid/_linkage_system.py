"""Linkages as hybrid systems: without guards."""

from collections.abc import Callable
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_methods import AbstractProjectingMethod, correct_step
from jaxbiped.dynamics._constrained_motion import LinkageState, linkage_field
from jaxbiped.hybrid._endings import ending_events
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._implicit_field import ImplicitField, with_unit_mass
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.scene._linkages import LinkageScene


class Swinging(AbstractSystem):
    """A linkage in gravity."""

    vector_field: ClassVar[ImplicitField] = with_unit_mass(linkage_field)

    def switches(self, args: LinkageScene, y: LinkageState) -> tuple[Switch, ...]:
        return ()

    def ending(self, args: LinkageScene, y: LinkageState) -> Scalar:
        return jnp.asarray(0)

    def failures(self, watch: tuple[str, ...]) -> dict[Ending, Callable[..., Scalar]]:
        return ending_events(watch)

    def reset_map(self, args: LinkageScene, y: LinkageState) -> LinkageState:
        return y

    def load(self, args: LinkageScene, y: LinkageState) -> None:
        return None

    def projects(self, args: LinkageScene) -> bool:
        return args.method.projects

    def project(self, args: LinkageScene, y: PyTree) -> LinkageState:
        assert isinstance(args.method, AbstractProjectingMethod)
        return LinkageState(*map(tuple, correct_step(args.linkage, args.method, *y)))

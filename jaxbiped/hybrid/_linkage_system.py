"""Linkages as hybrid systems: without guards."""

from collections.abc import Callable
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, Time
from jaxbiped.constraints._constraint_methods import AbstractProjectingMethod, correct_step
from jaxbiped.dynamics._constrained_motion import LinkageState, linkage_field
from jaxbiped.hybrid._endings import ending_events
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._implicit_field import AbstractImplicitField, Residual
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.linalg._sparse_lu import SparseMatrix
from jaxbiped.scene._linkages import LinkageScene


class LinkageField(AbstractImplicitField):
    """`linkage_field`, whose implicit form is its own."""

    def __call__(self, t: Time, y: LinkageState, args: LinkageScene) -> LinkageState:
        return linkage_field(t, y, args)

    def mass_matrix(self, y: LinkageState, args: LinkageScene) -> SparseMatrix:
        return {}

    def residual(self, y: LinkageState, rates: LinkageState, args: LinkageScene) -> Residual:
        here = linkage_field(jnp.zeros(()), y, args)
        pairs = zip((*here.q, *here.v), (*rates.q, *rates.v), strict=True)
        return {i: a - b for i, (a, b) in enumerate(pairs)}


class Swinging(AbstractSystem):
    """A linkage in gravity."""

    vector_field: ClassVar[LinkageField] = LinkageField()

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

"""The rates of a system as a function of components and parameters."""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.solve._columns import Seeded, with_active


class FieldRates(eqx.Module):
    """Components (c,) and active parameters (p,), one by one, to the rates.

    One by one, because pulling back through arrays of them makes programs that compile for
    seconds.

    Attributes:
        field: the vector field (t, state, args).
        args: parameters, the active ones among them replaced.
        structure: of the state.
    """

    field: Callable[[Any, PyTree, PyTree], PyTree] = eqx.field(static=True)
    args: Seeded
    structure: Any = eqx.field(static=True)

    def state(self, components: Sequence[Scalar]) -> PyTree:
        """The state of these components."""
        return jtu.tree_unflatten(self.structure, list(components))

    def scene(self, parameters: Sequence[Scalar]) -> PyTree:
        """The arguments with these active parameters."""
        return with_active(self.args, list(parameters))

    def __call__(self, z: Sequence[Scalar]) -> list[Scalar]:
        c = self.structure.num_leaves
        state, scene = self.state(z[:c]), self.scene(z[c:])
        return jtu.tree_leaves(self.field(jnp.zeros(()), state, scene))

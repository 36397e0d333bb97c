"""The rates of a system as a function of components and parameters, and their derivatives."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._system import AbstractSystem
from jaxbiped.lanes._mapped import mapped
from jaxbiped.solve._columns import Seeded, with_active


class FieldRates(eqx.Module):
    """Components (c,) and active parameters (p,), one by one, to the rates.

    One by one, because pulling back through arrays of them makes programs that compile for
    seconds.

    Attributes:
        system: whose rates.
        args: parameters, the active ones among them replaced.
        structure: of the state.
        engine: what computes the derivatives at many points, "xla" or "lanes".
    """

    system: AbstractSystem
    args: Seeded
    structure: Any = eqx.field(static=True)
    engine: str = eqx.field(static=True)

    def __call__(self, z: Sequence[Scalar]) -> list[Scalar]:
        c = self.structure.num_leaves
        state = jtu.tree_unflatten(self.structure, list(z[:c]))
        rates = self.system.vector_field(jnp.zeros(()), state, with_active(self.args, list(z[c:])))
        return jtu.tree_leaves(rates)

    def gradients_by_lanes(self, z: Scalar, along: Scalar | None) -> Scalar:
        """Derivatives of each rate by all of `z` (c + p,), or of their derivative along a tangent.

        Shape (c, c + p); under `vmap` every point has a lane.
        """
        leaves, structure = jtu.tree_flatten(self.args.args)
        turned = along is not None
        function = _Gradients(self.system, structure, self.structure, self.args.active, turned)
        parts = [z, *([] if along is None else [along]), jnp.stack(leaves)]
        return mapped(function, jnp.concatenate(parts)).reshape(-1, z.shape[0])


class _Gradients(eqx.Module):
    """Of the rates, row by row: from z, a tangent where `turned`, and all parameters."""

    system: AbstractSystem
    args: Any = eqx.field(static=True)
    state: Any = eqx.field(static=True)
    active: tuple[int, ...] = eqx.field(static=True)
    turned: bool = eqx.field(static=True)

    def __call__(self, numbers: Sequence[Scalar]) -> list[Scalar]:
        size = self.state.num_leaves + len(self.active)
        z, rest = list(numbers[:size]), list(numbers[size:])
        along = [rest.pop(0) for _ in range(size)] if self.turned else None
        args: PyTree = jtu.tree_unflatten(self.args, rest)
        nothing = jnp.zeros((0, 0))
        rates = FieldRates(
            self.system, Seeded(args, nothing, nothing, self.active), self.state, "lanes"
        )

        def turned(z: list[Scalar]) -> list[Scalar]:
            return rates(z) if along is None else jax.jvp(rates, (z,), (along,))[1]

        values, pull = jax.vjp(turned, z)
        rows = []
        for i in range(len(values)):
            rows += pull([jnp.asarray(1.0 if i == j else 0.0) for j in range(len(values))])[0]
        return rows

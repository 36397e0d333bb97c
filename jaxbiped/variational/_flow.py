"""Flow of a system: rates, switches, section and reset map of components and parameters.

The second variation differentiates with respect to both, which here are one vector.
"""

from collections.abc import Callable, Sequence

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree, PyTreeDef

from jaxbiped._types import Scalar, VectorField
from jaxbiped.dynamics._switches import Switch
from jaxbiped.variational._hybrid_system import AbstractSystem
from jaxbiped.variational._switch_locator import MARGIN
from jaxbiped.variational._tangents import Seeded, with_active

Arrival = Callable[[PyTree, PyTree], tuple[Scalar, Scalar]]
"""Of (args, state): a section's value, and whether a crossing counts."""


class Flow(eqx.Module):
    """What moves c components under p active parameters.

    Components and parameters come one by one to the rates, because pulling back through arrays of
    them makes programs that compile for seconds; to the rest as one vector z, shape (c + p,).

    Attributes:
        system: what moves.
        arrival: the section.
        field: the system's vector field (t, state, args).
        args: its parameters, of which the active ones are replaced.
        structure: of the state.
    """

    system: AbstractSystem = eqx.field(static=True)
    arrival: Arrival = eqx.field(static=True)
    field: VectorField = eqx.field(static=True)
    args: Seeded
    structure: PyTreeDef = eqx.field(static=True)

    def rates(self, y: Sequence[Scalar], parameters: Sequence[Scalar]) -> list[Scalar]:
        """The rates of the components."""
        state, scene = self._parts([*y, *parameters])
        return jtu.tree_leaves(self.field(jnp.zeros(()), state, scene))

    def velocity(self, z: Scalar) -> Scalar:
        """The same, shape (c,)."""
        c = self.structure.num_leaves
        return jnp.stack(self.rates(list(z[:c]), list(z[c:])))

    def surfaces(self, z: Scalar) -> tuple[Switch, ...]:
        """The switches."""
        state, scene = self._parts(z)
        return self.system.switches(scene, state)

    def reset(self, z: Scalar) -> Scalar:
        """The components after an arrival's reset, shape (c,)."""
        state, scene = self._parts(z)
        return jnp.stack(jtu.tree_leaves(self.system.reset_map(scene, state)))

    def section(self, z: Scalar) -> Scalar:
        """The section's value."""
        state, scene = self._parts(z)
        return self.arrival(scene, state)[0]

    def earlier(self, row: Scalar, parameters: Scalar) -> Scalar:
        """Time and components, (1 + c,), as little earlier as tells a switch's sides apart."""
        rates = self.velocity(jnp.concatenate([row[1:], parameters]))
        return row - MARGIN * jnp.concatenate([jnp.ones(1), rates])

    def _parts(self, z: Sequence[Scalar] | Scalar) -> tuple[PyTree, PyTree]:
        c = self.structure.num_leaves
        state = jtu.tree_unflatten(self.structure, list(z[:c]))
        return state, with_active(self.args, list(z[c:]))

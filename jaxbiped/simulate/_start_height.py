"""Height of a start: on the ground, or so deep in it that no contact law means it."""

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import BristleState, State
from jaxbiped.scene._ground import AbstractClearance
from jaxbiped.scene._scene import RedundantScene, Scene
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw

_DEEPEST = 0.25
"""Penetration of a foot that touches, in units of l, from which it starts below the ground."""
_HIGHEST = 100.0
"""Energy stored in a foot's contact, in units of m g l, from which it does."""


def check_start_height(scene: Scene | RedundantScene, state: State | BristleState) -> None:
    """Refuses a start below the ground, where all values are known.

    The deepest that is allowed is l/4, and so deep that the contact stores what would throw the
    walker a hundred legs high, 100 m g l: contact so stiff is to be started near its surface.

    Raises:
        ArgumentError: a deeper start.
    """
    leaves = jtu.tree_leaves((scene, state))
    if any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
        return
    # Plain numbers: operations of JAX by themselves would be compiled one by one.
    walker, g = jtu.tree_map(float, scene.walker), float(scene.ground.g)
    lift, hip_z = walker.total_mass * g * walker.l, float(state.hip_z)
    if hip_z <= 0.0:
        raise ArgumentError(
            f"state.hip_z = {hip_z:g} is not allowed: the walker starts below the ground, its hip "
            "under the surface; start higher."
        )
    angles, rates = (state.theta_1, state.theta_2), (state.omega_1, state.omega_2)
    depths = [walker.r - hip_z + walker.hip_to_foot * math.cos(float(angle)) for angle in angles]
    if max(depths) <= 0.0:
        return
    given = scene.clearance, scene.normal, depths, rates
    energies = _contact_energies(*jtu.tree_map(np.asarray, given))
    stored, depth, leg = max(zip(map(float, energies), depths, (1, 2), strict=True))
    if stored > 0.0 and (depth > _DEEPEST * walker.l or stored > _HIGHEST * lift > 0.0):
        raise ArgumentError(
            f"state.hip_z = {hip_z:g} is not allowed: foot {leg} starts {depth:.3g} m below the "
            f"ground, where its contact stores {stored:.3g} J (m g l is {lift:.3g} J); it just "
            f"touches at hip_z = {hip_z + depth:.9g}."
        )


@cached_jit
def _contact_energies(
    clearance: AbstractClearance,
    law: AbstractNormalLaw,
    depths: Sequence[Scalar],
    rates: Sequence[Scalar],
) -> list[Scalar]:
    """The energy in the contact of each foot, 0 where it does not touch [J]."""

    def stored(leg: int, depth: Scalar, rate: Scalar) -> Scalar:
        admitted = clearance.admits(leg, rate)
        touches = (depth > 0.0) & (True if admitted is None else admitted)
        return jnp.where(touches, law.elastic_energy(depth), 0.0)

    return [stored(1, depths[0], rates[0]), stored(2, depths[1], rates[1])]

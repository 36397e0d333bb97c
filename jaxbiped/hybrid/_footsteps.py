"""Footsteps of a walker's cycle: where feet strike, and whether they are deep underground.

The return map has fixed points that no walk reaches: under the clearance rule a foot may swing
deep underground and be caught there. Stability does not tell them from gaits, so depth does.
"""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, any_of
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._footfalls import FootMotion, landings, standing_leg, touches
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._structure import Structure

_DEEPEST = 3.0
"""Elastic force of a standing foot, in units of the walker's weight: about 1 where it stands."""


def stands_too_deep(scene: Scene, state: PyTree) -> Scalar:
    """Whether a foot that touches is deep underground (boolean)."""
    weight = scene.mechanism.total_mass * scene.ground.g

    def deep(foot: FootMotion) -> Scalar:
        return touches(foot) & (scene.normal.elastic_force(foot.penetration) > _DEEPEST * weight)

    return any_of([deep(foot) for foot in feet(scene, state)])


def places_of_landings(scene: Scene, states: PyTree, count: int) -> Scalar:
    """Places where feet land in the first footsteps [m], shape (count,); NaN where there are fewer.

    Leaves of the states have the shape (arrivals, nodes).
    """
    structure = scene.mechanism.structure
    found = jax.vmap(jax.vmap(lambda y: feet(scene, y)))(states)
    before = jtu.tree_map(lambda x: x[:, :-1], found)
    after = jtu.tree_map(lambda x: x[:, 1:], found)
    lands = jnp.stack(landings(structure, before, after))
    places = jnp.stack([_place_of_strike([after[k] for k in leg]) for leg in structure.feet_of_leg])
    lands, places = (_in_names_of_start(structure, each) for each in (lands, places))
    stands = standing_leg(structure, jtu.tree_map(lambda x: x[0, 0], found))
    return _first_strikes(lands, places, stands - 1, count)


def _place_of_strike(feet_of_leg: list[FootMotion]) -> Scalar:
    """Where the first of a leg's feet that touches is [m]."""
    *others, place = [foot.x for foot in feet_of_leg]
    for foot, own in zip(reversed(feet_of_leg[:-1]), reversed(others), strict=True):
        place = jnp.where(touches(foot), own, place)
    return place


def _in_names_of_start(structure: Structure, values: Scalar) -> Scalar:
    """Values of legs, shape (legs, arrivals, nodes), as (legs, all nodes).

    Names are exchanged at each arrival.
    """
    every = [
        jnp.stack([values[k, i] for k in structure.legs_renamed(i)]) for i in range(values.shape[1])
    ]
    return jnp.concatenate(every, axis=1)


def _first_strikes(lands: Scalar, places: Scalar, stands: Scalar, count: int) -> Scalar:
    """Places of the first footsteps, shape (count,); NaN where there are fewer.

    A landing is one where another leg made the one before; at first `stands` is that leg's number,
    −1 for none.
    """
    legs, n = lands.shape
    number, node = jnp.arange(legs)[:, None], jnp.arange(n)
    found, at = [], jnp.asarray(-1)
    for _ in range(count):
        ahead = lands & (node > at)
        if legs > 1:
            ahead &= number != stands
        at = jnp.min(jnp.where(ahead, node, n))
        here = ahead & (node == at)
        stands = jnp.max(jnp.where(here, number, -1))
        found.append(jnp.where(at < n, jnp.max(jnp.where(here, places, -jnp.inf)), jnp.nan))
    return jnp.stack(found)


def distances(places: Scalar, advance: Scalar) -> Scalar:
    """Distances between successive places, the first from the last one of the cycle before."""
    return places - jnp.concatenate([places[-1:] - advance, places[:-1]])

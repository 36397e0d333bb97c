"""Path of a gait: the nodes of its cycle, and the steps between its heel strikes."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._footfalls import FootMotion, landings, standing_leg, touches
from jaxbiped.gait._fixed_point_search import FixedPointProblem
from jaxbiped.gait._poincare_map import LinearisedReturn
from jaxbiped.scene._structure import Structure


def nodes_of(last: LinearisedReturn, like: PyTree) -> tuple[Scalar, PyTree]:
    """Times and states of a cycle's nodes, leaves of shape (arrivals, nodes); NaN beyond them."""
    nodes = last.nodes
    assert nodes is not None
    times, *states = jax.vmap(lambda ends, start: ends.columns(start))(nodes.ends, nodes.start)
    return times, jtu.tree_unflatten(jtu.tree_structure(like), states)


def step_lengths(problem: FixedPointProblem, last: LinearisedReturn, states: PyTree) -> Scalar:
    """Distances between the places of successive heel strikes in a cycle [m], shape (footsteps,).

    The first one is from the last strike of the cycle before. Rigid feet: of the root point's
    places just after the strikes.
    """
    mechanism = problem.args.mechanism
    structure, steps = mechanism.structure, problem.spec.steps
    count = steps * problem.args.arrival_footsteps
    if count == 1:
        return last.advance
    if not problem.args.compliant:
        assert last.nodes is not None
        return _distances(last.nodes.start[:, 1], last.advance)
    scene = problem.args.minimal
    found = jax.vmap(jax.vmap(lambda y: feet(scene, y)))(states)
    before = jtu.tree_map(lambda x: x[:, :-1], found)
    after = jtu.tree_map(lambda x: x[:, 1:], found)
    lands = jnp.stack(landings(structure, before, after))
    places = jnp.stack([_place_of_strike([after[k] for k in leg]) for leg in structure.feet_of_leg])
    lands, places = (_in_names_of_start(structure, each) for each in (lands, places))
    stands = standing_leg(structure, jtu.tree_map(lambda x: x[0, 0], found))
    return _distances(_first_strikes(lands, places, stands - 1, count), last.advance)


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


def _distances(places: Scalar, advance: Scalar) -> Scalar:
    return places - jnp.concatenate([places[-1:] - advance, places[:-1]])

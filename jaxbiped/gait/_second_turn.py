"""Second derivatives of the return map at a periodic orbit."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._bent import Bent, bend, on_surface
from jaxbiped.gait._curvature import along_path
from jaxbiped.gait._field_rates import FieldRates
from jaxbiped.gait._radau import Rates, velocities
from jaxbiped.gait._turn import Turn, Turning, recurring_places
from jaxbiped.solve._columns import Seeded, active_leaves, with_active
from jaxbiped.solve._landing import MARGIN
from jaxbiped.solve._passage import arrival_at


def second_turn(
    turning: Turning,
    args: Seeded,
    like: PyTree,
    last: Turn,
    turned: Scalar,
    tangents: Scalar,
    turned_seeds: Scalar,
    tangent_seeds: Scalar,
) -> Scalar:
    """Second derivatives of one turn along two sets of directions.

    Args:
        turning: how the turn was made.
        args: parameters.
        like: a state, for its structure.
        last: the turn, with its nodes.
        turned: v directions of the m recurring components, shape (m, v).
        tangents: q others, shape (m, q).
        turned_seeds, tangent_seeds: the same of the p active parameters.

    Returns:
        Shape (m + 1 + d, q, v): of the recurring components on the section, the period, and the
        advances.
    """
    leaves, structure = jtu.tree_flatten(like)
    c, count = len(leaves), turned.shape[1]
    places = jnp.asarray(recurring_places(turning.system, like))
    drifting = jnp.asarray(turning.system.drifting, dtype=int)
    seeds = jnp.concatenate([turned_seeds, tangent_seeds], axis=1)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(args)])
    watch = turning.watch(args.args, like)

    def parts(z: Sequence[Scalar] | Scalar) -> tuple[PyTree, PyTree]:
        return jtu.tree_unflatten(structure, list(z[:c])), with_active(args, list(z[c:]))

    def vector(y: PyTree) -> Scalar:
        return jnp.stack(jtu.tree_leaves(y))

    rates = FieldRates(turning.system, args, structure, turning.second_engine)

    def surfaces(z: Scalar) -> Any:
        state, scene = parts(z)
        return turning.system.switches(scene, state)

    def renewed(z: Scalar) -> Scalar:
        state, scene = parts(z)
        return vector(turning.system.renew(scene, state))

    def section(z: Scalar) -> Scalar:
        state, scene = parts(z)
        assert watch.section is not None
        return watch.section(scene, state)[0]

    first = jnp.zeros((c, seeds.shape[1])).at[places].set(jnp.concatenate([turned, tangents], 1))
    bent = Bent(first, jnp.zeros((c, tangents.shape[1], count)))
    times, states = last.nodes
    for k in range(turning.steps):
        nodes = jnp.stack([leaf[k] for leaf in jtu.tree_leaves(states)], axis=-1)
        end = jnp.sum(jnp.isfinite(times[k])) - 1
        # The last step ends on the section, not just past it.
        arrived, past = arrival_at(
            watch, jtu.tree_unflatten(structure, list(nodes[end])), args.args
        )
        clock = times[k].at[end].add(-past)
        nodes = nodes.at[end].set(vector(arrived))
        # A section may be a switch, as touchdown is: the motion begins and ends before it.
        clock, nodes = _earlier(rates, clock, nodes, jnp.stack([0, end]), parameters)
        bent = along_path(rates, surfaces, clock, nodes, parameters, bent, seeds, count)
        z = jnp.concatenate([nodes[end], parameters])
        if k + 1 < turning.steps:
            bent = bend(renewed, z, bent, seeds, count)
    on_section, period = on_surface(rates, section, z, bent, seeds, count)
    final = bend(renewed, z, on_section, seeds, count)
    parted = [final.second[places], period.second[None], final.second[drifting]]
    return jnp.concatenate(parted)


def _earlier(
    rates: Rates,
    clock: Scalar,
    nodes: Scalar,
    places: Scalar,
    parameters: Scalar,
) -> tuple[Scalar, Scalar]:
    """Times and states, some of them as little earlier as tells a switch's sides apart."""
    back = -MARGIN * velocities(rates, nodes[places], parameters)
    return clock.at[places].add(-MARGIN), nodes.at[places].add(back)

"""Second derivatives of the return map at a periodic orbit."""

from typing import Any

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._bent import Bent, bend, on_surface
from jaxbiped.gait._bent_solve import along_nodes
from jaxbiped.gait._curvature import along_path
from jaxbiped.gait._field_rates import FieldRates
from jaxbiped.gait._radau import Rates, velocities
from jaxbiped.gait._turn import Turn, Turning, recurring_places
from jaxbiped.solve._columns import Seeded, active_leaves
from jaxbiped.solve._landing import MARGIN
from jaxbiped.solve._passage import arrival_at


def second_turn(
    turning: Turning,
    args: Seeded,
    like: PyTree,
    last: Turn,
    turned: Scalar,
    tangents: Scalar,
    sizes: Scalar,
) -> Scalar:
    """Second derivatives of one turn along two sets of directions.

    Args:
        turning: how the turn was made.
        args: parameters.
        like: a state, for its structure.
        last: the turn, with its nodes.
        turned: v directions of the m recurring components, which move no parameter; (m, v).
        tangents: p others, each of which moves one active parameter, shape (m, p).
        sizes: by how much, shape (p,).

    Returns:
        Shape (m + 1 + d, p, v): of the recurring components on the section, the period, and the
        advances.
    """
    leaves, structure = jtu.tree_flatten(like)
    c, count = len(leaves), turned.shape[1]
    places = jnp.asarray(recurring_places(turning.system, like))
    drifting = jnp.asarray(turning.system.drifting, dtype=int)
    seeds = jnp.concatenate([jnp.zeros((len(sizes), count)), jnp.diag(sizes)], axis=1)
    parameters = jnp.stack([jnp.asarray(leaf) for leaf in active_leaves(args)])
    watch = turning.watch(args.args, like)
    rates = FieldRates(turning.system.vector_field, args, structure)

    def parts(z: Scalar) -> tuple[PyTree, PyTree]:
        return rates.state(list(z[:c])), rates.scene(list(z[c:]))

    def vector(y: PyTree) -> Scalar:
        return jnp.stack(jtu.tree_leaves(y))

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
        if turning.engine == "lanes":
            bent = along_nodes(turning.system, rates, clock, nodes, end, bent, sizes)
        else:
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

"""Derivatives of motions carried backwards in time, and by columns carried forwards."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped.caching._cached_jit import note_code
from jaxbiped.compiler import LANES
from jaxbiped.gait._poincare_map import linearised_return, recurring_indices, seed_directions
from jaxbiped.hybrid._sections import section_of
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.optimise._augmented_system import MotionSection
from jaxbiped.optimise._cycle_costs import CostedCycle
from jaxbiped.optimise._cycle_functionals import cycle_spec
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.solve._accuracy import Precision
from jaxbiped.variational._first_adjoint import Arriving, Row, pull_back_row
from jaxbiped.variational._flow import Flow
from jaxbiped.variational._tangents import active_leaves, with_active

FINE, LOOSE = Precision(1e-9, 1e-8), Precision(1e-8, 1e-7)


class Motion(NamedTuple):
    """A motion over some arrivals, and what is differentiated with respect to."""

    scene: object
    system: object
    section: object
    start: object
    steps: int
    names: tuple | None = None


def motion(scene, state, steps=1, costs=(), names=None):
    walker, section = system_of(scene), section_of(scene, None)
    if not costs:
        return Motion(scene, walker, section, state, steps, names)
    system = CostedCycle.of(walker, costs)
    return Motion(scene, system, MotionSection(section), system.begin(state), steps, names)


def derivatives(motion, precision, engine=LANES, by_time=0.0):
    """Of a sum of the last state and the time of arrival: forwards, backwards, and on the way."""
    scene, system, section, y, steps, names = motion
    name = "lanes" if engine is LANES else "xla"
    spec = cycle_spec(scene, system, section, steps, name)
    note_code(spec, scene)
    places, cyclic = np.array(recurring_indices(system, y)), np.array(system.cyclic_coordinates)
    _, active = select_parameters(scene, names)
    seeds, sizes = seed_directions(scene, active, len(places))
    structure = jtu.tree_structure(y)
    flow = Flow(system, spec.watch(scene, y).section, system.vector_field, seeds, structure)
    weights = np.random.default_rng(0).standard_normal(structure.num_leaves)

    @jax.jit
    def both(y):
        forwards = linearised_return(spec.with_more_steps(), seeds, y, precision, False)
        once = linearised_return(spec, seeds, y, precision, False, carries_parameters=False)
        row = Row(jnp.asarray(weights), jnp.zeros(len(active)))
        for k in reversed(range(steps)):
            nodes = jax.tree.map(lambda leaf, k=k: leaf[k], once.nodes)
            behind = Arriving(row, jnp.asarray(by_time))
            row, along = pull_back_row(engine, flow, nodes, behind)
        return forwards, row, along

    last, row, along = both(y)
    expected = weights[places] @ last.jacobian + weights[cyclic] @ last.advance_rows
    expected = expected + by_time * last.period_row
    # A cycle's start is held where it must be, a locked knee for example.
    held = lambda y, values: system.on_held(with_active(seeds, values), y)
    _, pull = jax.vjp(held, y, active_leaves(seeds))
    by_state, by_values = pull(jtu.tree_unflatten(structure, list(row.state)))
    row = Row(np.stack(jtu.tree_leaves(by_state)), row.parameters + np.array(by_values))
    known = np.asarray(along.values)[: int(along.counts)]
    assert int(last.code) == 0
    return expected, np.concatenate([row.state[places], row.parameters * sizes]), known

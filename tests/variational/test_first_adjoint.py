"""Derivatives carried backwards in time, against the columns that are carried forwards."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.caching._cached_jit import note_code
from jaxbiped.compiler import LANES, XLA
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
from tests.hybrid.test_clock_on_compliant_feet import GAIT, SCENE
from tests.optimise.test_costs_of_motion import DRIVEN, SQUARE_AT_STRIKE, START

FINE, LOOSE = Precision(1e-9, 1e-8), Precision(1e-8, 1e-7)
SEED = jb.seed_scene()


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


def assert_within_bars(motion, **how):
    (forwards, backwards, _), (looser, rougher, _) = (
        derivatives(motion, precision, **how) for precision in (FINE, LOOSE)
    )
    bars = np.abs(forwards - looser) + np.abs(backwards - rougher)
    np.testing.assert_array_less(np.abs(backwards - forwards), bars + 1e-10 * np.abs(forwards))
    return np.max(np.abs(backwards - forwards)) / np.max(np.abs(forwards))


def test_rows_through_a_footstep_are_the_columns_of_the_return():
    """With an integral, a term at the strike, and the time of arrival."""
    once = motion(DRIVEN, START, costs=(SQUARE_AT_STRIKE,))
    assert assert_within_bars(once, by_time=0.7) < 1e-9
    fewer = once._replace(names=())
    whole, own = (derivatives(each, FINE)[1] for each in (once, fewer))
    np.testing.assert_allclose(own, whole[: len(own)], rtol=1e-12)


def test_a_rollout_is_taken_footstep_by_footstep():
    gait = jb.find_gait(DRIVEN, START, parameters=())
    rollout = motion(DRIVEN, gait.measures.state, steps=3, costs=(SQUARE_AT_STRIKE,))
    assert assert_within_bars(rollout) < 1e-8


def test_the_hamiltonian_is_constant_along_a_footstep():
    """That is the costate times the rates of an autonomous motion."""
    once = motion(DRIVEN, START, costs=(SQUARE_AT_STRIKE,))
    _, _, along = derivatives(once, FINE)
    states, rows = np.split(along[:, 1 : -len(jb.parameter_names(DRIVEN))], 2, axis=1)
    structure = jtu.tree_structure(once.start)

    def rates(y):
        state = jtu.tree_unflatten(structure, list(y))
        return jnp.stack(jtu.tree_leaves(once.system.vector_field(0.0, state, DRIVEN)))

    energy = np.sum(rows * jax.vmap(rates)(jnp.asarray(states)), axis=1)
    assert np.ptp(energy) < 1e-8 * np.max(np.abs(rows))
    assert len(along) > 20
    assert np.all(np.diff(along[:, 0]) < 0.0)
    assert abs(along[-1, 0]) < 1e-9


@pytest.mark.slow
def test_rows_by_xla_are_those_by_lanes():
    once = motion(DRIVEN, START, costs=(SQUARE_AT_STRIKE,))
    lanes, xla = (derivatives(once, FINE, engine)[1] for engine in (LANES, XLA))
    np.testing.assert_allclose(xla, lanes, rtol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(
    "once",
    [
        pytest.param(motion(SEED, jb.seed_state(), steps=2), id="corners"),
        pytest.param(motion(SCENE, GAIT, steps=2), id="a clock that strikes restart"),
    ],
)
def test_rows_on_compliant_feet_are_the_columns(once):
    forwards, backwards, _ = derivatives(once, FINE)
    assert np.max(np.abs(backwards - forwards)) < 2e-6 * np.max(np.abs(forwards))


@pytest.mark.slow
def test_rows_jump_where_the_force_does():
    """At touchdown of feet by Kelvin and Voigt."""
    law = jb.laws.KelvinVoigt.from_weight(mass=3.0, penetration=2e-4, damping_ratio=0.3)
    scene = dataclasses.replace(SEED, normal=law)
    gait = jb.find_gait(scene, radius_sensitivities=False)
    forwards, backwards, _ = derivatives(motion(scene, gait.measures.state), FINE)
    assert np.max(np.abs(backwards - forwards)) < 2e-6 * np.max(np.abs(forwards))


@pytest.mark.slow
def test_rows_pass_a_knee_that_locks():
    scene = jb.models.hsu_chen()
    gait = jb.find_gait(scene, radius_sensitivities=False)
    forwards, backwards, _ = derivatives(motion(scene, gait.measures.state), FINE)
    assert np.max(np.abs(backwards - forwards)) < 1e-7 * np.max(np.abs(forwards))

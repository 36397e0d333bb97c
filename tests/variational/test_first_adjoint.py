"""Derivatives carried backwards in time, against the columns that are carried forwards."""

import dataclasses

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import LANES, XLA
from tests.hybrid.test_clock_on_compliant_feet import GAIT, SCENE
from tests.optimise.test_costs_of_motion import DRIVEN, SQUARE_AT_STRIKE, START
from tests.variational.rows import FINE, LOOSE, derivatives, motion

SEED = jb.seed_scene()


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


@pytest.mark.nightly
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

"""The seed's gait, against published measures and differences; what a search costs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.compiler.one_shot import count_runs

pytestmark = pytest.mark.slow


def test_seed_gait(seed_gait):
    assert seed_gait.outcome == jb.gait.Search.FOUND
    assert seed_gait.critical == jb.gait.Bifurcation.NONE
    assert bool(seed_gait.stable)
    assert float(seed_gait.measures.period) == pytest.approx(0.4408349, abs=1e-7)
    assert float(seed_gait.measures.step_length) == pytest.approx(0.1792270, abs=1e-7)
    assert float(seed_gait.measures.peak_normal) == pytest.approx(308.7904, abs=1e-3)
    assert float(seed_gait.residual) < 1e-7
    assert float(seed_gait.unit_multiplier_error) < 1e-4
    assert seed_gait.multipliers.shape == (6,)


def test_no_return_is_solved_twice(seed_gait, monkeypatch):
    """The records of two turns are read at a search's end: they waited on the host."""
    runs = count_runs(monkeypatch)
    again = jb.find_gait(jb.seed_scene())
    # A run for each turn; a looser one from the gait itself, for its bars; that of the parameters,
    # and the second derivatives there and back.
    assert len(runs) == int(again.evaluations) + 4
    assert [room > 0 for _, _, room in runs] == [True] * (len(runs) - 1) + [False]
    np.testing.assert_array_equal(again.orbit[0], seed_gait.orbit[0])


def test_far_from_a_gait_derivatives_are_those_in_the_state():
    """By lanes: the return map's slopes are right there, of parameters nothing is claimed."""
    gait = jb.find_gait(jb.seed_scene(), max_evaluations=2)
    assert gait.outcome == jb.gait.Search.NOT_CONVERGED
    assert np.isnan(gait.sensitivities.period).all()
    start, h = gait.measures.state, 1e-6
    moved = [
        jb.return_map(
            jb.seed_scene(), start._replace(omega_2=start.omega_2 + step), accuracy="tight"
        ).time
        for step in (-h, h)
    ]
    m = len(start) - 1
    slope = float(moved[1] - moved[0]) / (2.0 * h)
    np.testing.assert_allclose(gait.return_jacobian[m, m - 1], slope, rtol=2e-3)


def test_a_guess_in_float32_is_followed_in_64_bits():
    coarse = jax.tree.map(np.float32, jb.seed_state())
    starts = coarse, jax.tree.map(float, coarse)
    periods = [jb.find_gait(jb.seed_scene(), y).measures.period for y in starts]
    times = [jb.return_map(jb.seed_scene(), y).time for y in starts]
    assert (float(periods[0]), float(times[0])) == (float(periods[1]), float(times[1]))


def test_a_start_that_falls_gives_no_gait():
    state = jb.seed_state()._replace(omega_2=jnp.asarray(-3.0), hip_vx=jnp.asarray(1.5))
    gait = jb.find_gait(jb.seed_scene(), state)
    assert gait.outcome == jb.gait.Search.NO_RETURN
    assert gait.walk_outcome != jb.Ending.WALKING
    assert not np.isfinite(float(gait.residual))
    assert np.isnan(float(gait.measures.period))
    assert not bool(gait.stable)


def test_no_gait_on_the_level():
    """A slope of nothing feeds no energy: the search says so, with what it had."""
    gait = jb.find_gait(jb.seed_scene(slope=0.0))
    assert gait.outcome in (jb.gait.Search.NO_RETURN, jb.gait.Search.NOT_CONVERGED)
    assert not bool(gait.stable)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (dict(accuracy="fast"), "choose one of draft, balanced, tight"),
        (dict(accuracy=0.0), "accuracy = 0 is not allowed"),
        (dict(footsteps=0), "footsteps"),
        (dict(footsteps=1.5), "footsteps"),
        (dict(parameters=("K", "stiffness")), "parameters"),
        (dict(method="secant"), "method"),
        (dict(max_evaluations=0), "max_evaluations"),
        (dict(solver="euler"), "solver"),
        (dict(solver="kvaerno3", engine="lanes"), "Kvaerno3 is not one of its solvers"),
        (dict(engine="fast"), "choose one of auto, xla, lanes"),
    ],
)
def test_bad_arguments(options, named):
    with pytest.raises(jb.ArgumentError, match=named):
        jb.find_gait(jb.seed_scene(), **options)


def test_a_batch_as_guess_is_refused():
    many = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), jb.seed_state())
    with pytest.raises(jb.ArgumentError, match=r"jax\.vmap"):
        jb.find_gait(jb.seed_scene(), many)


def test_a_gait_is_a_guess_as_its_state_is():
    scene, plain = jb.ladder()["rigid"], dict(parameters=(), radius_sensitivities=False)
    near = jb.find_gait(jb.with_parameters(scene, {"slope": 0.021}), **plain)
    found = [jb.find_gait(scene, guess, **plain) for guess in (near, near.measures.state)]
    assert found[0].found_by is jb.gait.FoundBy.GUESS
    assert [float(gait.measures.period) for gait in found] == [float(found[1].measures.period)] * 2
    with pytest.raises(jb.ArgumentError, match="guess"):
        jb.find_gait(jb.seed_scene(), near)

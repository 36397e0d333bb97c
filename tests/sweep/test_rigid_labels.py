"""Labels of the rigid walker at the default accuracy, against tight walks of the same starts."""

import jax
import jax.tree_util as jtu
import numpy as np
import pytest
from reference.rigid_walks import rigid_walks

import jaxbiped as jb
from tests.rigid_walkers import rigid_seed


@pytest.mark.slow
def test_verdicts_about_a_weakly_stable_gait_are_those_of_tight_walks():
    """Slow transients past an unstable gait are not taken for a gait, and no strike is missed."""
    scene = rigid_seed(0.003)
    gait = jb.find_gait(scene).measures.state
    random, count = np.random.default_rng(3), 2000
    sizes = (0.0, 0.06, 0.06, 0.4, 0.4)
    starts = type(gait)(
        *[float(x) + random.uniform(-a, a, count) for x, a in zip(gait, sizes, strict=True)]
    )
    found = jb.labelling(scene, footsteps=200)(starts)
    tight = jax.jit(
        jax.vmap(
            lambda state: jb.rigid_walk(
                scene, state, footsteps=200, accuracy="tight", engine="lanes"
            )
        )
    )(starts)
    codes = np.asarray(tight.ending)
    assert np.sum((found.label == 0) != (codes == 0)) <= 1
    both = (found.label > 0) & (codes > 0)
    assert np.sum(found.label[both] != codes[both]) <= 1


def test_falls_are_told_with_the_time_of_the_fall_and_no_strike_is_counted_twice():
    labelling = jb.labelling(rigid_seed())
    axes = {"omega_swing": np.linspace(-4.0, 5.0, 13), "theta_swing": np.linspace(-0.5, 0.8, 13)}
    states = jb.starts.grid(labelling.scene, axes).at(labelling, np.arange(169)).states
    found = labelling(states)
    true = rigid_walks(labelling.scene, states, 3)
    fell = np.isfinite(true.falls)
    footsteps, back = np.isfinite(true.strikes).sum(axis=1), true.last[:, 1] > 0.0
    np.testing.assert_array_equal(found.footsteps[fell], footsteps[fell])
    np.testing.assert_array_equal(found.label[fell] == jb.basins.Label.FELL_BACK, back[fell])
    np.testing.assert_allclose(found.time[fell], true.falls[fell], rtol=5e-3)
    assert fell.sum() > 100
    assert 10 < back[fell].sum() < 100


def test_a_gait_is_a_guess():
    """Its state alone is: warnings of what else it holds are errors here."""
    gait = jb.find_gait(rigid_seed(), parameters=(), radius_sensitivities=False)
    near = jb.labelling(rigid_seed(), guess=gait).family.rows[0][0].state
    assert type(near) is jb.dynamics.RigidState
    np.testing.assert_allclose(near[1:], gait.measures.state[1:], atol=1e-9)


def test_labels_by_a_share_doubt_a_foot_that_grazes():
    """Two neighbours of which small steps say that one strikes at first and the other does not."""
    labelling = jb.labelling(rigid_seed(), accuracy=1e-2)
    rates = np.array([-1.8965, -1.8964, -1.7])
    start = jb.dynamics.RigidState(0.0, 0.4209, 0.23985298, rates, -1.64274848)
    early = rigid_walks(labelling.scene, start, 1, duration=1.0).strikes[:, 0]
    assert np.isfinite(early).tolist() == [False, True, True]
    found = labelling(jtu.tree_map(lambda leaf: np.broadcast_to(leaf, rates.shape), start))
    assert found.doubt is not None
    assert (found.doubt != int(jb.basins.Doubt.NONE)).tolist() == [True, True, False]

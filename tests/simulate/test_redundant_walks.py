"""Walks in redundant coordinates against the minimal formulation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow

FOOTSTEP = 0.440835
HUNDRED = 100.0 * FOOTSTEP


@pytest.fixture(scope="module")
def long_walks():
    """Ten and a hundred footsteps' time by three methods, at the usual settings."""

    def walks(name):
        scene = jb.RedundantScene(jb.seed_scene(), name)
        how = dict(save="end", watch=(), extremes=jb.dynamics.violation)
        return [
            jb.simulate(scene, jb.seed_state(), duration=t, **how) for t in (0.1 * HUNDRED, HUNDRED)
        ]

    return {name: walks(name) for name in ("standard", "augmented", "described")}


@pytest.mark.nightly
def test_drift_over_a_hundred_footsteps(long_walks):
    """The standard method's grows with time; a penalty bounds it; a projection leaves none."""
    ten, hundred = (
        {name: float(walks[k].highest.position) for name, walks in long_walks.items()}
        for k in (0, 1)
    )
    assert hundred["standard"] > 4.0 * ten["standard"] > 1e-8
    assert hundred["augmented"] < 1.5 * ten["augmented"]
    assert hundred["augmented"] < 0.1 * hundred["standard"]
    assert hundred["described"] < 1e-12


@pytest.mark.nightly
def test_all_walk_at_the_minimal_ones_pace(long_walks):
    truth = jb.simulate(jb.seed_scene(), jb.seed_state(), duration=HUNDRED, save="end").final
    for walks in long_walks.values():
        assert walks[1].outcome is jb.Ending.WALKING
        assert walks[1].correction is not None
        final = jb.dynamics.minimal_state(jb.RedundantScene(jb.seed_scene()), walks[1].final)
        assert float(final.hip_x) == pytest.approx(float(truth.hip_x), rel=1e-3)
        # A step's length lost or won over all of them would be 1e-2 of each.
        assert abs(float(final.theta_2 - truth.theta_2)) < 1e-2


@pytest.mark.parametrize("method", ["penalty", "described"])
def test_lanes_take_the_same_footsteps(method):
    """Against the minimal formulation at a tight tolerance."""
    scene = jb.RedundantScene(jb.seed_scene(), method)
    how = dict(duration=0.9, save="end", extremes=jb.dynamics.violation)
    found = jb.simulate(scene, jb.seed_state(), engine="lanes", **how)
    assert found.engine == "lanes"
    assert found.outcome is jb.Ending.WALKING
    assert found.correction is not None
    truth = jb.simulate(jb.seed_scene(), jb.seed_state(), duration=0.9, save="end", rtol=1e-10)
    final = jb.dynamics.minimal_state(scene, found.final)
    np.testing.assert_allclose(np.array(final), np.array(truth.final), rtol=0.0, atol=1e-4)
    bound = 1e-14 if method == "described" else 1e-7
    assert 0.0 < float(found.highest.position) < bound


def test_lanes_batch_redundant_walks_and_have_no_derivatives():
    def end(change):
        how = dict(duration=0.1, save="end", engine="lanes")
        scene = jb.with_parameters(jb.seed_scene(), {"c": 1e7 * (1.0 + change)})
        held = jb.RedundantScene(scene, "described")
        return jb.simulate(held, jb.seed_state(), **how).final.theta_2

    several = jax.vmap(end)(jnp.asarray([0.0, 0.2]))
    np.testing.assert_allclose(several, [end(0.0), end(0.2)], rtol=1e-13)
    assert several[0] != several[1]
    with pytest.raises(jb.ArgumentError, match=r"RedundantScene.* is not allowed under deriv"):
        jax.grad(end)(0.0)

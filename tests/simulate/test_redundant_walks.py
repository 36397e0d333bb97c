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


def test_lanes_batch_redundant_walks():
    def end(change):
        how = dict(duration=0.1, save="end", engine="lanes")
        scene = jb.with_parameters(jb.seed_scene(), {"c": 1e7 * (1.0 + change)})
        held = jb.RedundantScene(scene, "described")
        return jb.simulate(held, jb.seed_state(), **how).final.theta_2

    several = jax.vmap(end)(jnp.asarray([0.0, 0.2]))
    np.testing.assert_allclose(several, [end(0.0), end(0.2)], rtol=1e-13)
    assert several[0] != several[1]


@pytest.mark.parametrize(
    ("method", "orientation", "saved"),
    [
        ("described", "angle", "end"),
        pytest.param("described", "euler", "strikes", marks=pytest.mark.nightly),
        *(
            pytest.param(name, "angle", "end", marks=pytest.mark.nightly)
            for name in ("standard", "baumgarte", "penalty", "augmented", "index1", "index1aug")
        ),
    ],
)
def test_derivatives_are_those_of_the_minimal_walk(method, orientation, saved):
    """With respect to a rate and the slope, of the state a time or a heel strike later."""
    seed = jb.seed_scene()
    how = dict(save="end", duration=0.6)
    if saved == "strikes":
        how = dict(save=jb.HeelStrike(), duration=0.5, max_arrivals=1)

    def walked(held, point):
        scene = jb.with_parameters(seed, {"slope": point[1]})
        start, scene = jb.seed_state()._replace(omega_1=point[0]), held(scene)
        walk = jb.simulate(scene, start, **how)
        found = walk if walk.arrivals is None else walk.arrivals
        state = jax.tree.map(lambda leaf: leaf[0], found.state)
        state = jb.dynamics.minimal_state(scene, state) if scene.redundant else state
        return jnp.stack([found.t[0], *state])

    point = jnp.array([-0.0052, 0.02])
    redundant = lambda scene: jb.RedundantScene(scene, method, orientation)
    ours = jax.jacfwd(lambda x: walked(redundant, x))(point)
    plain = jax.jacfwd(lambda x: walked(lambda scene: scene, x))(point)
    np.testing.assert_allclose(ours, plain, rtol=1e-4, atol=1e-4 * np.abs(plain).max())

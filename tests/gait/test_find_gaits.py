"""Gaits found from many starts at once, against a stable and an unstable one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow


def test_many_starts_find_a_stable_and_an_unstable_gait():
    scene = jb.seed_scene()
    starts = jax.tree.map(lambda leaf: leaf[:4], jb.gait.rolling_starts(scene, 12))
    found = jb.find_gaits(scene, starts)
    period = np.asarray(found.gaits.measures.period)
    stable = np.asarray(found.gaits.stable)
    assert period[stable] == pytest.approx([0.4408349], abs=1e-6)
    assert period[~stable] == pytest.approx([0.3910974], abs=1e-6)
    # One start leads to an orbit whose feet swing 9 mm underground; a search from it says so, too.
    underground = np.asarray(found.ending) == int(jb.gait.Search.NO_WALK)
    assert np.sum(underground) == 1
    guess = jax.tree.map(lambda leaf: leaf[np.flatnonzero(underground)[0]], starts)
    alone = jb.find_gait(scene, guess, parameters=(), radius_sensitivities=False)
    assert str(alone.outcome) == "no walk"
    assert int(np.sum(found.reached)) == int(np.sum(np.asarray(found.which) >= 0))
    assert np.all((np.asarray(found.ending) == 0) == (np.asarray(found.which) >= 0))
    assert np.all(np.diff(np.asarray(found.reached)) <= 0)
    # The seed's own start is the first, and leads to the stable one.
    assert bool(stable[int(found.which[0])])


def test_a_cycle_that_is_entered_at_either_footstep_is_one_gait():
    scene = jb.with_parameters(jb.ladder()["rigid"], {"slope": 0.102})
    first = jb.find_gait(scene, footsteps=2, parameters=(), radius_sensitivities=False)
    second = jb.return_map(scene, first.measures.state).state
    starts = jax.tree.map(lambda a, b: jnp.stack([a, b]), first.measures.state, second)
    found = jb.find_gaits(scene, starts, footsteps=2)
    assert np.asarray(found.reached).tolist() == [2]
    assert np.asarray(found.gaits.cycle_footsteps).tolist() == [2]


@pytest.mark.parametrize("footsteps", [2, 3, 6])
def test_an_unstable_gait_is_a_cycle_of_several_footsteps_too(footsteps):
    """Residuals of such a cycle are enlarged by its multiplier, of up to 34 here."""
    scene, plain = jb.seed_scene(slope=0.12), dict(parameters=(), radius_sensitivities=False)
    one = jb.find_gait(scene, accuracy="tight", **plain)
    several = jb.find_gait(scene, one, footsteps=footsteps, **plain)
    assert several.outcome is jb.gait.Search.FOUND
    assert int(several.cycle_footsteps) == 1
    measures, truth = several.measures, one.measures
    assert float(measures.period) == pytest.approx(footsteps * float(truth.period), rel=1e-6)
    off = abs(float(measures.spectral_radius) - float(truth.spectral_radius) ** footsteps)
    assert off < 1e-3 * footsteps * float(measures.spectral_radius)


@pytest.mark.parametrize("shape", [(), (2, 2), (0,)])
def test_starts_of_another_shape_are_refused(shape):
    starts = jax.tree.map(lambda leaf: jnp.full(shape, leaf), jb.seed_state())
    with pytest.raises(jb.ArgumentError, match="starts"):
        jb.find_gaits(jb.seed_scene(), starts)


def test_bad_arguments():
    with pytest.raises(jb.ArgumentError, match="accuracy"):
        jb.find_gaits(jb.seed_scene(), jb.gait.rolling_starts(jb.seed_scene(), 2), accuracy="fast")
